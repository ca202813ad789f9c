/* Frames as lines of a candump log. */
#include <string.h>

#include "wrcd_frame.h"

static char *put(char *to, uint64_t number, int digits, unsigned base, const char *after)
{
    for (int k = digits; k-- > 0; number /= base)
        to[k] = "0123456789ABCDEF"[number % base];
    return (char *)memcpy(to + digits, after, strlen(after)) + strlen(after);
}

/* Classical data frames, records of `stride` bytes, each to 64 bytes at most and what is between stamp and id, of `length`
 * bytes. Returns the bytes. */
int64_t wrcd_write_lines(const unsigned char *records, int64_t stride, int64_t frames, const char *between, int64_t length,
                         char *text)
{
    char *to = text;

    for (int64_t k = 0; k < frames; k++, *to++ = '\n') {
        const wrcd_frame_head *f = (const wrcd_frame_head *)(const void *)(records + k * stride);
        const uint64_t us = f->stamp_us < 0 ? 0 - (uint64_t)f->stamp_us : (uint64_t)f->stamp_us;
        int digits = 10;
        for (uint64_t left = us / 1000000; left >= 10000000000; left /= 10)
            digits++;
        to = put(put(to, 0, 0, 10, f->stamp_us < 0 ? "(-" : "("), us / 1000000, digits, 10, ".");
        to = (char *)memcpy(put(to, us % 1000000, 6, 10, ""), between, (size_t)length) + length;
        to = put(to, f->word & 0x1FFFFFFF, f->word >> 31 ? 8 : 3, 16, "#");
        for (int i = 0; i < f->length; i++)
            to = put(to, f->data[i], 2, 16, "");
    }
    return to - text;
}
