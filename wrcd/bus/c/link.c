/* Many frames a system call, each way, on a raw CAN socket: what SocketCanLink does one by one. */
#define _GNU_SOURCE
#include <errno.h>
#include <linux/can.h>
#include <stdbool.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

#include "wrcd_frame.h"

enum { AT_ONCE = 64, STAMP = 35 /* SO_TIMESTAMPNS with a struct of two longs */, LOST = 40 /* SO_RXQ_OVFL */ };

typedef struct {
    int32_t error;     /* errno of what ended it; 0: there is no more, or no room */
    int32_t confirmed; /* how many of ours have left */
    int32_t odd;       /* frames that are no data frames, or under an id of our own */
    uint32_t lost;     /* the newest count of frames that the socket's buffer has lost, 0 where none is given */
} wrcd_received;

typedef struct { long seconds, nanoseconds; } stamp; /* of the kernel, whatever time_t is */
typedef union { struct cmsghdr aligned; char bytes[64]; } ancillary;

static void look_beside(struct msghdr *head, wrcd_frame *frame, wrcd_received *of)
{
    for (struct cmsghdr *c = CMSG_FIRSTHDR(head); c; c = CMSG_NXTHDR(head, c)) {
        if (c->cmsg_level != SOL_SOCKET)
            continue;
        if (c->cmsg_type == STAMP) {
            stamp at;
            memcpy(&at, CMSG_DATA(c), sizeof at);
            frame->stamp_us = (int64_t)at.seconds * 1000000 + at.nanoseconds / 1000;
            frame->flags &= (uint8_t)~WRCD_UNSTAMPED;
        } else if (c->cmsg_type == LOST) {
            memcpy(&of->lost, CMSG_DATA(c), sizeof of->lost);
        }
    }
}

/* A standard id has eleven bits: a virtual bus may carry more, and the kernel's filters do not see them. */
static uint32_t word_of(canid_t id)
{
    return id & (CAN_EFF_FLAG | CAN_ERR_FLAG) ? id : id & (CAN_RTR_FLAG | CAN_SFF_MASK);
}

static bool is_odd(const wrcd_frame *frame, const uint32_t *own, int owns)
{
    bool odd = frame->word & (CAN_RTR_FLAG | CAN_ERR_FLAG);
    for (int i = 0; i < owns && !odd; i++)
        odd = frame->word == own[i];
    return odd;
}

/* Reads classical frames, `most` at the most, without waiting; own: words of the messages sent here. A frame without a
 * time stamp gets now_us. Ours that have left are counted, and are not among the frames. Returns how many there are. */
int wrcd_receive(int fd, wrcd_frame *out, int most, int64_t now_us, const uint32_t *own, int owns, wrcd_received *of)
{
    struct can_frame raw[AT_ONCE];
    ancillary beside[AT_ONCE];
    struct iovec parts[AT_ONCE];
    struct mmsghdr heads[AT_ONCE];
    int count = 0;
    memset(of, 0, sizeof *of);
    while (count < most) {
        const int wanted = most - count < AT_ONCE ? most - count : AT_ONCE;
        for (int i = 0; i < wanted; i++) {
            parts[i] = (struct iovec){&raw[i], sizeof raw[i]};
            heads[i] = (struct mmsghdr){.msg_hdr = {.msg_iov = &parts[i], .msg_iovlen = 1, .msg_control = &beside[i],
                                                    .msg_controllen = sizeof beside[i]}};
        }
        const int got = recvmmsg(fd, heads, (unsigned)wanted, MSG_DONTWAIT, NULL);
        if (got < 0) {
            of->error = errno == EAGAIN ? 0 : errno;
            break;
        }
        for (int i = 0; i < got; i++) {
            wrcd_frame *frame = &out[count];
            if (heads[i].msg_len != sizeof raw[i])
                continue;
            *frame = (wrcd_frame){.stamp_us = now_us, .word = word_of(raw[i].can_id), .flags = WRCD_UNSTAMPED};
            frame->length = raw[i].can_dlc <= 8 ? raw[i].can_dlc : 8;
            memcpy(frame->data, raw[i].data, frame->length);
            look_beside(&heads[i].msg_hdr, frame, of);
            if (heads[i].msg_hdr.msg_flags & MSG_CONFIRM) {
                of->confirmed++;
                continue;
            }
            of->odd += is_odd(frame, own, owns);
            count++;
        }
        if (got < wanted)
            break;
    }
    return count;
}

/* Sends frames until one cannot be sent at once. Returns how many went, or -errno where the first did not. */
int wrcd_send(int fd, const wrcd_frame *frames, int count)
{
    struct can_frame raw[AT_ONCE];
    struct iovec parts[AT_ONCE];
    struct mmsghdr heads[AT_ONCE];
    int sent = 0;
    while (sent < count) {
        const int wanted = count - sent < AT_ONCE ? count - sent : AT_ONCE;
        for (int i = 0; i < wanted; i++) {
            const wrcd_frame *frame = &frames[sent + i];
            raw[i] = (struct can_frame){.can_id = frame->word, .can_dlc = frame->length};
            memcpy(raw[i].data, frame->data, sizeof raw[i].data);
            parts[i] = (struct iovec){&raw[i], sizeof raw[i]};
            heads[i] = (struct mmsghdr){.msg_hdr = {.msg_iov = &parts[i], .msg_iovlen = 1}};
        }
        const int went = sendmmsg(fd, heads, (unsigned)wanted, MSG_DONTWAIT);
        if (went < 0)
            return sent ? sent : -errno;
        sent += went;
    }
    return sent;
}
