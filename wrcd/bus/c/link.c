/* Many frames a system call, each way, on a raw CAN socket: classical ones, and CAN FD where it is wanted. */
#define _GNU_SOURCE
#include <errno.h>
#include <linux/can.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include "wrcd_frame.h"

enum {
    AT_ONCE = 64,
    STAMP = 35,  /* SO_TIMESTAMPNS with a struct of two longs */
    STAMPS = 37, /* SO_TIMESTAMPING with three of them: the kernel's, one that is empty, the controller's */
    LOST = 40    /* SO_RXQ_OVFL */
};

typedef struct {
    int32_t error;     /* errno of what ended it; 0: there is no more, or no room */
    int32_t confirmed; /* how many of ours have left */
    int32_t odd;       /* frames that are no data frames, or under an id of our own */
    uint32_t lost;     /* the newest count of frames that the socket's buffer has lost, 0 where none is given */
} wrcd_received;

typedef struct { long seconds, nanoseconds; } stamp; /* of the kernel, whatever time_t is */
typedef union { struct cmsghdr aligned; char bytes[128]; } ancillary;
typedef struct { int64_t kernel_us, hardware_us, lost; } wrcd_beside; /* lost: of a wrcd_received */

static int64_t time_us(const unsigned char *of)
{
    stamp at;
    memcpy(&at, of, sizeof at);
    return (int64_t)at.seconds * 1000000 + at.nanoseconds / 1000;
}

/* Takes what recvmsg gives beside a frame; what is not there is left as it was. */
void wrcd_look_beside(void *control, size_t bytes, wrcd_beside *of)
{
    struct msghdr head = {.msg_control = control, .msg_controllen = bytes};
    for (struct cmsghdr *c = CMSG_FIRSTHDR(&head); c; c = CMSG_NXTHDR(&head, c)) {
        uint32_t lost;
        if (c->cmsg_level != SOL_SOCKET)
            continue;
        if (c->cmsg_type == STAMP || c->cmsg_type == STAMPS)
            of->kernel_us = time_us(CMSG_DATA(c));
        if (c->cmsg_type == STAMPS)
            of->hardware_us = time_us(CMSG_DATA(c) + 2 * sizeof(stamp));
        if (c->cmsg_type == LOST) {
            memcpy(&lost, CMSG_DATA(c), sizeof lost);
            of->lost = lost;
        }
    }
}

/* Lays a controller's own clock, which counts from anywhere and drifts, on the kernel's.
 *
 * A frame is never stamped by the kernel before the controller has it, so the least difference of the two that was seen
 * lately is the offset between the clocks. Lately is 10 to 20 s: a drift of 50 ppm is a millisecond in that time. */
enum {
    KEPT_US = 10000000, STEP_US = 1000000,
    /* So many frames in a row that seem to be late by more than that: the kernel's clock has been set forwards. */
    MAX_LATE_US = 5000, MAX_LATE_FRAMES = 50
};
typedef struct { int64_t since_us, newest_us, before_us, late, is_known; } wrcd_hardware_clock; /* all 0 before the first */

static int64_t least(int64_t a, int64_t b) { return a < b ? a : b; }

/* The controller's stamp on the kernel's clock, never later than the kernel's own. raw_us is 0 for a frame that the controller
 * has not stamped: it has the kernel's. */
int64_t wrcd_to_kernel_time(wrcd_hardware_clock *c, int64_t raw_us, int64_t kernel_us)
{
    const int64_t offset_us = kernel_us - raw_us, late_us = offset_us - least(c->newest_us, c->before_us);
    if (!raw_us)
        return kernel_us;
    c->late = c->is_known && late_us > MAX_LATE_US ? c->late + 1 : 0;
    if (!c->is_known || llabs(late_us) > STEP_US || c->late > MAX_LATE_FRAMES) { /* it has stepped */
        *c = (wrcd_hardware_clock){kernel_us, offset_us, offset_us, 0, 1};
    } else if (kernel_us - c->since_us > KEPT_US) {
        c->before_us = c->newest_us;
        c->newest_us = offset_us;
        c->since_us = kernel_us;
    }
    c->newest_us = least(c->newest_us, offset_us);
    return raw_us + least(c->newest_us, c->before_us);
}

/* A standard id has eleven bits: a virtual bus may carry more, and the kernel's filters do not see them. */
static uint32_t word_of(canid_t id)
{
    return id & (CAN_EFF_FLAG | CAN_ERR_FLAG) ? id : id & (CAN_RTR_FLAG | CAN_SFF_MASK);
}

static bool is_odd(uint32_t word, const uint32_t *own, int owns)
{
    bool odd = word & (CAN_RTR_FLAG | CAN_ERR_FLAG);
    for (int i = 0; i < owns && !odd; i++)
        odd = word == own[i];
    return odd;
}

/* Reads frames, `most` at the most, without waiting, into records of `stride` bytes: a wrcd_frame's, with room for CAN FD's
 * data where such frames are wanted. own: words of the messages sent here. A frame without a time stamp gets now_us. clock:
 * frames have the controller's stamps where it makes any, or NULL. Ours that have left are counted, and are not among the
 * frames. Returns how many there are. */
int wrcd_receive(int fd, unsigned char *out, int64_t stride, int most, int64_t now_us, const uint32_t *own, int owns,
                 wrcd_hardware_clock *clock, wrcd_received *of)
{
    struct canfd_frame raw[AT_ONCE];
    ancillary beside[AT_ONCE];
    struct iovec parts[AT_ONCE];
    struct mmsghdr heads[AT_ONCE];
    const int64_t room = stride - (int64_t)sizeof(wrcd_frame_head);
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
            wrcd_frame_head *frame = (wrcd_frame_head *)(void *)(out + count * stride);
            wrcd_beside found = {now_us, 0, of->lost};
            wrcd_look_beside(&beside[i], heads[i].msg_hdr.msg_controllen, &found);
            of->lost = (uint32_t)found.lost;
            if (heads[i].msg_hdr.msg_flags & MSG_CONFIRM) {
                of->confirmed++;
                continue;
            }
            const bool is_fd = heads[i].msg_len == CANFD_MTU;
            const int64_t longest = is_fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN;
            if ((heads[i].msg_len != CAN_MTU && !is_fd) || longest > room)
                continue;
            memset(frame, 0, (size_t)stride);
            frame->stamp_us = clock ? wrcd_to_kernel_time(clock, found.hardware_us, found.kernel_us) : found.kernel_us;
            frame->word = word_of(raw[i].can_id) & ~(is_fd ? CAN_RTR_FLAG : 0U);
            frame->length = raw[i].len <= longest ? raw[i].len : (uint8_t)longest;
            frame->flags = is_fd ? WRCD_FD | (raw[i].flags & WRCD_FD_BITS) : 0;
            memcpy(frame->data, raw[i].data, frame->length);
            of->odd += is_odd(frame->word, own, owns);
            count++;
        }
        if (got < wanted)
            break;
    }
    return count;
}

/* Sends classical frames, of records of `stride` bytes, until one cannot be sent at once. Returns how many went, or -errno where
 * the first did not. */
int wrcd_send(int fd, const unsigned char *records, int64_t stride, int count)
{
    struct can_frame raw[AT_ONCE];
    struct iovec parts[AT_ONCE];
    struct mmsghdr heads[AT_ONCE];
    int sent = 0;
    while (sent < count) {
        const int wanted = count - sent < AT_ONCE ? count - sent : AT_ONCE;
        for (int i = 0; i < wanted; i++) {
            const wrcd_frame_head *frame = (const wrcd_frame_head *)(const void *)(records + (sent + i) * stride);
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
