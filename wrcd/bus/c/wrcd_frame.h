/* A classical CAN frame as it was received. */
#ifndef WRCD_FRAME_H
#define WRCD_FRAME_H

#include <stdint.h>

typedef struct {
    int64_t stamp_us;  /* since 1970 */
    uint32_t word;     /* the id, with the kernel's flags of 29 bits, of a request and of an error */
    uint8_t length, flags;
    uint16_t cause;    /* of what is sent: why an axle is not Valid */
    uint8_t data[8];
} wrcd_frame;

enum { WRCD_CONFIRM = 1 /* one of ours has left */, WRCD_NO_STAMP = 2 /* the kernel gave none */ };
#define WRCD_EXTENDED 0x80000000U
#define WRCD_REMOTE 0x40000000U
#define WRCD_ERROR 0x20000000U

#endif
