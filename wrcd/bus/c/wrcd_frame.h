/* A classical CAN frame as it lies in memory between the socket and the core; wrcd/bus/batch.py has the same. */
#ifndef WRCD_FRAME_H
#define WRCD_FRAME_H

#include <stdint.h>

enum { WRCD_CONFIRM = 1, /* one of ours has left */ WRCD_UNSTAMPED = 2 /* the kernel gave no time stamp */, WRCD_FD = 4 };

typedef struct {
    int64_t stamp_us; /* since 1970, truncated */
    uint32_t word;    /* the id, and the kernel's CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_ERR_FLAG */
    uint8_t length;   /* of a remote frame what it asks for */
    uint8_t flags;
    uint16_t cause;   /* of one that is sent: why its axle is not Valid; else 0 */
    uint8_t data[8];   /* 0 behind the length */
} wrcd_frame;

_Static_assert(sizeof(wrcd_frame) == 24, "a record of the recorder's ring, too");

/* The same with as many bytes of data as a record of it has room for: 8, or 64 where CAN FD is among them. */
typedef struct {
    int64_t stamp_us;
    uint32_t word;
    uint8_t length, flags;
    uint16_t cause;
    uint8_t data[];
} wrcd_frame_head;

#endif
