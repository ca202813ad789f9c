/* Lines of a candump log to frames, as many at once as are regular; wrcd/logs/columns.py says which are. */
#include <stdbool.h>
#include <string.h>

#include "wrcd_frame.h"

enum { HEX_DIGIT = 16 };
static const uint8_t HEX[256] = { /* a digit's value, and that it is one */
    ['0'] = 16, ['1'] = 17, ['2'] = 18, ['3'] = 19, ['4'] = 20, ['5'] = 21, ['6'] = 22, ['7'] = 23, ['8'] = 24, ['9'] = 25,
    ['A'] = 26, ['B'] = 27, ['C'] = 28, ['D'] = 29, ['E'] = 30, ['F'] = 31,
    ['a'] = 26, ['b'] = 27, ['c'] = 28, ['d'] = 29, ['e'] = 30, ['f'] = 31};

/* The number of so many digits, a decimal point left out; at `most` 9 or 15. */
static bool number_of(const char *text, int64_t digits, uint8_t most, int64_t *number)
{
    bool is_one = true;

    for (int64_t k = 0; k < digits; k++) {
        const uint8_t digit = HEX[(uint8_t)text[k]];
        is_one = is_one && digit >= HEX_DIGIT && digit - HEX_DIGIT <= most;
        *number = *number * (most + 1) + (digit & 15);
    }
    return is_one;
}

static bool is_read(const char *line, int64_t length, const char *first, int64_t bracket, int64_t head, wrcd_frame *f)
{
    const bool directed = length > 2 && line[length - 2] == ' ' && (line[length - 1] == 'R' || line[length - 1] == 'T');
    const int64_t rest = length - (directed ? 2 : 0) - head, digits = rest % 2 ? 8 : 3, bytes = (rest - digits - 1) / 2;
    int64_t id = 0, nanoseconds = 0;

    if (rest <= digits || bytes > 8 || line[0] != '(' || line[11] != '.'
        || memcmp(line + bracket, first + bracket, (size_t)(head - bracket)) != 0)
        return false;
    bool is_good = number_of(line + 1, 10, 9, &f->stamp_us) && number_of(line + 12, 6, 9, &f->stamp_us)
        && number_of(line + 18, bracket - 18, 9, &nanoseconds) && number_of(line + head, digits, 15, &id)
        && line[head + digits] == '#';
    for (int64_t k = 0; k < bytes; k++) {
        int64_t byte = 0;
        is_good = number_of(line + head + digits + 1 + 2 * k, 2, 15, &byte) && is_good;
        f->data[k] = (uint8_t)byte;
    }
    f->word = (uint32_t)id | (digits == 8 ? 0x80000000U : 0U);
    f->length = (uint8_t)bytes;
    return is_good && id <= (digits == 8 ? 0x1FFFFFFF : 0x7FF);
}

/* Lines as frames, zeros before, and which are regular: the channel, between bracket and head, is that of the first line. */
void wrcd_read_lines(const char *text, int64_t lines, const int64_t *ends, int64_t bracket, int64_t head, wrcd_frame *frame,
                     uint8_t *is_regular)
{
    for (int64_t k = 0, start = 0; k < lines; start = ends[k++] + 1)
        is_regular[k] = is_read(text + start, ends[k] - start, text, bracket, head, &frame[k]);
}
