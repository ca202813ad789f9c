/* AUTOSAR E2E Profile 11, data id mode "both": CRC in byte 0, counter 0 ... 14 in the low nibble of byte 1.
 *
 * A good CRC with a counter that does not continue the chain is refused, and remembered as a rival's. If the rival goes on
 * and the chain does not, the sender has started anew: the chain is the rival's from its second frame on. If both go on
 * beside each other, there are two senders, and neither is believed until one has been silent for a whole turn of the
 * counter. So a stray frame costs at most one good one; a second sender is suspected at its second frame and found at its
 * third.
 *
 * Two senders leave no silence: a rival that comes after one of more than 1 + MAX_LOST of its own cycles is the chain's
 * sender, of which many frames were lost. */
#include "core.h"

enum {
    MAX_LOST = 2,            /* counts that may be missing between two frames that are used one after the other */
    CANDIDATE_FRAMES = 3,    /* of a rival that continue each other: a second sender, no stray frames */
    CANDIDATE_FORGOTTEN = 4, /* frames of the chain alone after which a stray one is forgotten */
    MOVE = 4, MAX_MOVES = 2, /* to another chain once or twice: a sender that starts anew; more: two senders */
    MOST_MOVES = 1 << 30,    /* two senders may go on for years */
    NONE = -1
};

/* SAE J1850: x^8 + x^4 + x^3 + x^2 + 1. */
static const uint8_t CRC[256] = {
    0x00, 0x1D, 0x3A, 0x27, 0x74, 0x69, 0x4E, 0x53, 0xE8, 0xF5, 0xD2, 0xCF, 0x9C, 0x81, 0xA6, 0xBB,
    0xCD, 0xD0, 0xF7, 0xEA, 0xB9, 0xA4, 0x83, 0x9E, 0x25, 0x38, 0x1F, 0x02, 0x51, 0x4C, 0x6B, 0x76,
    0x87, 0x9A, 0xBD, 0xA0, 0xF3, 0xEE, 0xC9, 0xD4, 0x6F, 0x72, 0x55, 0x48, 0x1B, 0x06, 0x21, 0x3C,
    0x4A, 0x57, 0x70, 0x6D, 0x3E, 0x23, 0x04, 0x19, 0xA2, 0xBF, 0x98, 0x85, 0xD6, 0xCB, 0xEC, 0xF1,
    0x13, 0x0E, 0x29, 0x34, 0x67, 0x7A, 0x5D, 0x40, 0xFB, 0xE6, 0xC1, 0xDC, 0x8F, 0x92, 0xB5, 0xA8,
    0xDE, 0xC3, 0xE4, 0xF9, 0xAA, 0xB7, 0x90, 0x8D, 0x36, 0x2B, 0x0C, 0x11, 0x42, 0x5F, 0x78, 0x65,
    0x94, 0x89, 0xAE, 0xB3, 0xE0, 0xFD, 0xDA, 0xC7, 0x7C, 0x61, 0x46, 0x5B, 0x08, 0x15, 0x32, 0x2F,
    0x59, 0x44, 0x63, 0x7E, 0x2D, 0x30, 0x17, 0x0A, 0xB1, 0xAC, 0x8B, 0x96, 0xC5, 0xD8, 0xFF, 0xE2,
    0x26, 0x3B, 0x1C, 0x01, 0x52, 0x4F, 0x68, 0x75, 0xCE, 0xD3, 0xF4, 0xE9, 0xBA, 0xA7, 0x80, 0x9D,
    0xEB, 0xF6, 0xD1, 0xCC, 0x9F, 0x82, 0xA5, 0xB8, 0x03, 0x1E, 0x39, 0x24, 0x77, 0x6A, 0x4D, 0x50,
    0xA1, 0xBC, 0x9B, 0x86, 0xD5, 0xC8, 0xEF, 0xF2, 0x49, 0x54, 0x73, 0x6E, 0x3D, 0x20, 0x07, 0x1A,
    0x6C, 0x71, 0x56, 0x4B, 0x18, 0x05, 0x22, 0x3F, 0x84, 0x99, 0xBE, 0xA3, 0xF0, 0xED, 0xCA, 0xD7,
    0x35, 0x28, 0x0F, 0x12, 0x41, 0x5C, 0x7B, 0x66, 0xDD, 0xC0, 0xE7, 0xFA, 0xA9, 0xB4, 0x93, 0x8E,
    0xF8, 0xE5, 0xC2, 0xDF, 0x8C, 0x91, 0xB6, 0xAB, 0x10, 0x0D, 0x2A, 0x37, 0x64, 0x79, 0x5E, 0x43,
    0xB2, 0xAF, 0x88, 0x95, 0xC6, 0xDB, 0xFC, 0xE1, 0x5A, 0x47, 0x60, 0x7D, 0x2E, 0x33, 0x14, 0x09,
    0x7F, 0x62, 0x45, 0x58, 0x0B, 0x16, 0x31, 0x2C, 0x97, 0x8A, 0xAD, 0xB0, 0xE3, 0xFE, 0xD9, 0xC4,
};

uint8_t wrcd_crc_after(uint8_t start, const uint8_t *data, int length)
{
    uint8_t crc = start;

    for (int k = 1; k < length; k++)
        crc = CRC[crc ^ data[k]];
    return crc;
}

void wrcd_e2e_reset(wrcd_message_state *m)
{
    m->last = m->candidate = NONE;
    m->sender = NO_SENDER;
    m->last_us = m->candidate_us = WRCD_NEVER;
    m->candidate_frames = m->frames_since_candidate = m->moves = m->quarantine_frames = m->payload_bytes = m->contested_frames = 0;
}

bool wrcd_e2e_suspect(const wrcd_message_state *m)
{
    return m->candidate != NONE && m->candidate_frames >= CANDIDATE_FRAMES - 1;
}

static bool continues(int last, int counter)
{
    const int ahead = (counter - last + COUNTER_MODULO) % COUNTER_MODULO;

    return ahead >= 1 && ahead <= 1 + MAX_LOST;
}

/* This frame is the newest of the chain. */
static void follow(wrcd_message_state *m, int counter, const uint8_t *data, int length, int64_t stamp_us)
{
    m->last = counter;
    m->last_us = stamp_us;
    m->payload_bytes = length;
    memcpy(m->payload, data, (size_t)length);
}

static int believed(wrcd_message_state *m)
{
    if (m->quarantine_frames == 0)
        return WRCD_REASON_NONE;
    m->quarantine_frames--;
    return WRCD_REASON_TWO_SENDERS;
}

static int go_on(wrcd_message_state *m, int counter, const uint8_t *data, int length, int64_t stamp_us)
{
    follow(m, counter, data, length, stamp_us);
    m->frames_since_candidate += m->frames_since_candidate <= CANDIDATE_FORGOTTEN;
    m->moves -= m->moves > 0;
    if (m->frames_since_candidate > CANDIDATE_FORGOTTEN)
        m->candidate = NONE;
    return believed(m);
}

/* The rival goes on and the chain does not: they change places. */
static int move(wrcd_message_state *m, int counter, const uint8_t *data, int length, int64_t stamp_us)
{
    const int64_t silence_us = m->candidate_us - m->last_us, since_us = stamp_us - m->candidate_us;
    const int64_t counts = (counter - m->candidate + COUNTER_MODULO) % COUNTER_MODULO;

    if (silence_us * counts > (1 + MAX_LOST) * since_us) {
        m->candidate = NONE;
    } else {
        m->candidate = m->last;
        m->candidate_us = m->last_us;
        m->moves += m->moves < MOST_MOVES ? MOVE : 0;
        if (m->moves > MAX_MOVES * MOVE)
            m->quarantine_frames = COUNTER_MODULO;
    }
    m->candidate_frames = 1;
    m->frames_since_candidate = 0;
    follow(m, counter, data, length, stamp_us);
    return believed(m);
}

/* Whether a frame of the right length may be used; else why not. */
int wrcd_e2e_check(const wrcd_train *t, int message, const uint8_t *data, int length, int64_t stamp_us)
{
    const wrcd_message *of = &t->message[message];
    wrcd_message_state *m = &t->message_state[message];

    if (length < 2 || length > (int)sizeof m->payload || data[0] != wrcd_crc_after((uint8_t)of->crc_start, data, length)) {
        for (int k = 0; length > 0 && k < of->others; k++)
            if (data[0] == wrcd_crc_after((uint8_t)t->number[of->first_others + k], data, length))
                return WRCD_REASON_DATA_ID;
        return WRCD_REASON_CRC;
    }
    const int counter = data[1] & 0x0F;
    if (counter >= COUNTER_MODULO)
        return WRCD_REASON_COUNTER;
    if (m->last == NONE || continues(m->last, counter))
        return go_on(m, counter, data, length, stamp_us);
    const bool repeated = counter == m->last, rival = m->candidate != NONE && continues(m->candidate, counter);
    if (rival && m->frames_since_candidate == 0)
        return move(m, counter, data, length, stamp_us);
    if (repeated && length == m->payload_bytes && memcmp(data, m->payload, (size_t)length) == 0)
        return WRCD_REASON_REPEAT; /* a copy says nothing of a second sender */
    m->candidate_frames = rival ? m->candidate_frames + (m->candidate_frames < CANDIDATE_FRAMES) : 1;
    if (m->candidate_frames >= CANDIDATE_FRAMES)
        m->quarantine_frames = COUNTER_MODULO;
    m->candidate = counter;
    m->frames_since_candidate = 0;
    m->candidate_us = stamp_us;
    return m->quarantine_frames ? WRCD_REASON_TWO_SENDERS : repeated ? WRCD_REASON_REPEAT : WRCD_REASON_COUNTER;
}
