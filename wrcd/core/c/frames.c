/* A frame is accepted whole or refused whole, for the first reason that applies: kind, length, E2E, status, range. */
#include "core.h"

#define CAN_EXTENDED 0x80000000U
#define CAN_REMOTE 0x40000000U
#define CAN_ERROR 0x20000000U
#define CAN_ID 0x1FFFFFFFU

/* The mapped message of a frame's word, or whose group it is of; NULL: none. An error frame's class looks like an id, and never
 * is. */
const wrcd_message *wrcd_message_of(const wrcd_train *t, uint32_t word)
{
    const uint32_t key = word & (CAN_EXTENDED | CAN_ID);
    int first = 0, end = t->settings->messages;

    if (word & CAN_ERROR)
        return NULL;
    while (first < end) {
        const int middle = (first + end) / 2;
        if (t->message[middle].word < key)
            first = middle + 1;
        else
            end = middle;
    }
    if (first < t->settings->messages && t->message[first].word == key)
        return &t->message[first];
    for (int k = 0; key & CAN_EXTENDED && k < t->settings->messages; k++)
        if (((t->message[k].word ^ key) & t->message[k].mask) == 0)
            return &t->message[k];
    return NULL;
}

/* A field's bits; those that no frame has are 0. */
uint64_t wrcd_bits_of(const wrcd_field *at, const uint8_t *data, int length)
{
    uint64_t bits = 0;
    int got = -(at->shift % 8);

    for (int i = at->shift / 8; got < at->bits && i < length; i++, got += 8) {
        const uint64_t byte = data[at->is_big_endian ? length - 1 - i : i];
        bits |= got < 0 ? byte >> -got : byte << got;
    }
    return at->bits < 64 ? bits & (((uint64_t)1 << at->bits) - 1) : bits;
}

static int64_t with_sign(const wrcd_field *at, uint64_t bits)
{
    return at->kind == WRCD_SIGNED && at->bits < 64 && bits >> (at->bits - 1) ? (int64_t)(bits - ((uint64_t)1 << at->bits))
                                                                             : (int64_t)bits;
}

static double float_of(int bits, uint64_t raw)
{
    const uint32_t word = (uint32_t)raw;
    double number;
    float single;

    if (bits == 64) {
        memcpy(&number, &raw, sizeof number);
        return number;
    }
    if (bits == 32) {
        memcpy(&single, &word, sizeof single);
        return (double)single;
    }
    const int exponent = raw >> 10 & 31; /* 16 bits */
    const double fraction = (double)(raw & 1023);
    number = exponent == 31 ? NAN /* infinite, or no number */
        : exponent == 0 ? ldexp(fraction, -24) : ldexp(1024.0 + fraction, exponent - 25);
    return raw >> 15 & 1 ? -number : number;
}

/* A raw value as a number: of more than 53 bits rounded, by less than 2^-53 of what the field holds. */
static double number_of(const wrcd_field *at, uint64_t bits)
{
    return at->kind == WRCD_FLOAT ? float_of(at->bits, bits)
        : at->kind == WRCD_SIGNED ? (double)with_sign(at, bits) : (double)bits;
}

/* Whether a field's bits are those of a whole number. */
static bool is_number(const wrcd_field *at, uint64_t bits, int64_t whole)
{
    return at->kind == WRCD_FLOAT ? float_of(at->bits, bits) == (double)whole : with_sign(at, bits) == whole;
}

/* Whether a frame's multiplexers select what has these conditions. */
bool wrcd_carried(const wrcd_train *t, int first, int conditions, const uint8_t *data, int length)
{
    for (int k = first; k < first + conditions; k++) {
        const wrcd_condition *c = &t->condition[k];
        const wrcd_field at = {c->shift, c->bits, c->is_big_endian, c->kind};
        const uint64_t bits = wrcd_bits_of(&at, data, length);
        bool found = false;
        for (int i = 0; i < c->numbers && !found; i++)
            found = with_sign(&at, bits) == t->number[c->first_numbers + i];
        if (!found)
            return false;
    }
    return true;
}

/* Believe no status that came before, and follow every counter as it comes. */
void wrcd_forget_senders(const wrcd_train *t)
{
    for (int i = 0; i < t->settings->messages; i++)
        wrcd_e2e_reset(&t->message_state[i]);
    for (int i = 0; i < t->settings->statuses; i++)
        t->status_state[i].stamp_us = WRCD_NEVER;
}

static void keep_statuses(const wrcd_train *t, const wrcd_message *m, const uint8_t *data, int64_t stamp_us)
{
    for (int k = 0; k < m->tells; k++) {
        const int number = t->rule[m->first_tells + k];
        const wrcd_status_rule *r = &t->status[number];
        const wrcd_field at = {r->shift, r->bits, r->is_big_endian, r->kind};
        if (wrcd_carried(t, r->first_conditions, r->conditions, data, m->length))
            t->status_state[number] = (wrcd_status_state){wrcd_bits_of(&at, data, m->length), stamp_us};
    }
}

static bool is_among(const wrcd_train *t, const wrcd_field *at, uint64_t word, int first, int count)
{
    bool found = false;

    for (int i = first; i < first + count && !found; i++)
        found = at->kind == WRCD_FLOAT ? float_of(at->bits, word) == (double)t->number[i] : word == (uint64_t)t->number[i];
    return found;
}

/* Whether a frame's sender is to be believed by one status; if so, whether it calls itself degraded. */
static bool judged(const wrcd_train *t, int number, const wrcd_message *m, const wrcd_frame_head *f, bool *is_degraded)
{
    const wrcd_status_rule *r = &t->status[number];
    const wrcd_status_state *kept = &t->status_state[number];
    const wrcd_field at = {r->shift, r->bits, r->is_big_endian, r->kind};

    if (r->is_kept && (kept->stamp_us == WRCD_NEVER || f->stamp_us - kept->stamp_us > r->timeout_us))
        return false;
    const uint64_t word = r->is_kept ? kept->word : wrcd_bits_of(&at, f->data, m->length);
    if (is_among(t, &at, word, r->first_oks, r->oks))
        return true;
    *is_degraded = true;
    return is_among(t, &at, word, r->first_degradeds, r->degradeds);
}

/* -1 in reverse, else 1. A factor below 0 turns it. */
static double direction_of(const wrcd_train *t, const wrcd_input *s, const wrcd_field *at, uint64_t bits, double physical)
{
    bool is_reverse = !s->only_words && physical < 0.0;

    for (int i = 0; i < s->words; i++)
        if (is_number(at, bits, t->word[2 * (s->first_words + i)])) {
            is_reverse = t->word[2 * (s->first_words + i) + 1] != 0;
            break;
        }
    return is_reverse == (s->factor > 0.0) ? -1.0 : 1.0;
}

/* The SI value of a signal, or why it has none. */
static int read_value(const wrcd_train *t, const wrcd_input *s, const wrcd_message *m, const uint8_t *data, double *value)
{
    const wrcd_field at = {s->shift, s->bits, s->is_big_endian, s->kind};
    const uint64_t bits = wrcd_bits_of(&at, data, m->length);

    for (int i = 0; i < s->unusable; i++)
        if (is_number(&at, bits, t->number[s->first_unusable + i]))
            return WRCD_REASON_STATUS;
    const double physical = number_of(&at, bits) * s->scale + s->offset, si = physical * s->factor;
    if (!(s->low <= physical && physical <= s->high && fabs(si) <= s->limit))
        return isfinite(si) ? WRCD_REASON_RANGE : WRCD_REASON_NOT_FINITE;
    if ((s->quantity == WRCD_LOAD || s->quantity == WRCD_RADIUS) && si <= 0.0)
        return WRCD_REASON_RANGE;
    *value = s->quantity == WRCD_DIRECTION ? direction_of(t, s, &at, bits, physical) : si;
    return WRCD_REASON_NONE;
}

/* Whether a frame of a group comes from another address than the one before it, or so few frames ago one did: as of E2E's
 * counters, a new sender is believed when it has been the only one for a while. */
static bool is_of_two(const wrcd_message *m, wrcd_message_state *s, uint32_t word)
{
    const int32_t before = s->sender, now = (int32_t)(word & 0xFF);

    if ((m->mask & 0xFF) != 0)
        return false;
    s->sender = now;
    s->contested_frames = before != NO_SENDER && before != now ? COUNTER_MODULO
        : s->contested_frames > 0 ? s->contested_frames - 1 : 0;
    return s->contested_frames > 0;
}

/* The values of a frame of a mapped message, with room for so many bytes; none where a multiplexer selects none. Returns why
 * it is refused. */
int wrcd_read_frame(const wrcd_train *t, int message, const wrcd_frame_head *f, int64_t room, reading *values, int *count)
{
    const wrcd_message *m = &t->message[message];
    const bool is_fd = f->flags & WRCD_FD;
    bool is_degraded = false;

    *count = 0;
    if (f->word & (CAN_REMOTE | CAN_ERROR) || is_fd != (m->is_fd != 0))
        return WRCD_REASON_KIND;
    if (f->length != m->length || m->length > room)
        return WRCD_REASON_LENGTH;
    int reason = is_of_two(m, &t->message_state[message], f->word) ? WRCD_REASON_TWO_SENDERS : WRCD_REASON_NONE;
    if (m->is_protected && reason == WRCD_REASON_NONE)
        reason = wrcd_e2e_check(t, message, f->data, m->length, f->stamp_us);
    for (int k = 0; reason == WRCD_REASON_TWO_SENDERS && k < m->tells; k++)
        t->status_state[t->rule[m->first_tells + k]].stamp_us = WRCD_NEVER;
    if (reason != WRCD_REASON_NONE)
        return reason;
    keep_statuses(t, m, f->data, f->stamp_us);
    for (int i = m->first_signals; i < m->first_signals + m->signals; i++) {
        const wrcd_input *s = &t->input[i];
        if (!wrcd_carried(t, s->first_conditions, s->conditions, f->data, m->length))
            continue;
        values[(*count)++].input = i;
        for (int k = 0; k < s->rules; k++)
            if (!judged(t, t->rule[s->first_rules + k], m, f, &is_degraded))
                return WRCD_REASON_STATUS;
    }
    const bool is_contested = m->is_protected && wrcd_e2e_suspect(&t->message_state[message]);
    for (int k = 0; k < *count; k++) {
        reason = read_value(t, &t->input[values[k].input], m, f->data, &values[k].value);
        if (reason != WRCD_REASON_NONE)
            return reason;
        values[k].is_degraded = is_degraded;
        values[k].is_contested = is_contested;
    }
    return WRCD_REASON_NONE;
}

/* Whether a refused frame is one of an input: those that it carries, all where even that is not known. */
bool wrcd_is_concerned(const wrcd_train *t, const wrcd_message *m, int input, const wrcd_frame_head *f, int reason)
{
    const wrcd_input *i = &t->input[input];

    return !m->is_multiplexed || reason <= WRCD_REASON_TWO_SENDERS
        || wrcd_carried(t, i->first_conditions, i->conditions, f->data, m->length);
}
