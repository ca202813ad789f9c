/* A classical CAN frame as it lies in memory between the socket and the core; wrcd/bus/batch.py has the same. */
#ifndef WRCD_FRAME_H
#define WRCD_FRAME_H

#include <stdint.h>

/* Flags; a core looks at FD alone. Of CAN FD: bit rate switched, sender error passive. */
enum { WRCD_FD = 4, WRCD_FD_BITS = 3 };

typedef struct {
    int64_t stamp_us; /* since 1970, truncated */
    uint32_t word;    /* the id, as the kernel's: + 0x80000000 of 29 bits, + 0x40000000 remote, + 0x20000000 error */
    uint8_t length;   /* of a remote frame what it asks for */
    uint8_t flags;
    uint16_t cause;   /* of one that is sent: why its axle is not Valid; else 0 */
    uint8_t data[8];   /* 0 behind the length */
} wrcd_frame;

/* The same with as many bytes of data as a record of it has room for: 8, or 64 where CAN FD is among them. */
typedef struct {
    int64_t stamp_us;
    uint32_t word;
    uint8_t length, flags;
    uint16_t cause;
    uint8_t data[];
} wrcd_frame_head;

#endif
