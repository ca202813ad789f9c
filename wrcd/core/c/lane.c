/* As wrcd/core/{core,inputs,input_buffers,plausibility,validity}.py, and wrcd/bus/{readers,e2e}.py do it with good
 * frames and sound ticks. */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lane.h"

#define CAN_REMOTE 0x40000000U
#define CAN_ERROR 0x20000000U
enum { MAX_LOST = 2, REACH_BITS = 8 };
static const double MAX_FRAMES = 1000.0, BACKWARDS_M_S = 0.5;
static const double JUMP_US = 100000.0;

static wrcd_lane_place *at(wrcd_lane_place *place, const wrcd_lane *k, int quantity, int axle)
{
    return &place[quantity * k->axles + axle];
}

static wrcd_lane_message *message_of(const wrcd_lane *k, const wrcd_lane_tables *t, uint32_t word)
{
    wrcd_lane_message *message = t->message;
    int first = 0, end = k->messages;

    while (first < end) { /* they are sorted */
        const int middle = (first + end) / 2;
        if (message[middle].word < word)
            first = middle + 1;
        else
            end = middle;
    }
    return first < k->messages && message[first].word == word ? &message[first] : NULL;
}

static uint64_t whole_number(const uint8_t *data, int length, bool is_big_endian)
{
    uint64_t number = 0;

    for (int k = 0; k < length; k++)
        number = number << 8 | data[is_big_endian ? k : length - 1 - k];
    return number;
}

/* Whether a frame's CRC holds and its counter goes on. */
static bool is_intact(const wrcd_lane_message *m, const wrcd_frame *f, const uint8_t *crc_table)
{
    uint8_t crc = (uint8_t)m->crc_start;

    if (!m->is_protected)
        return true;
    if (m->length < 2 || m->is_suspicious)
        return false;
    for (int k = 1; k < m->length; k++)
        crc = crc_table[crc ^ f->data[k]];
    const int counter = f->data[1] & 0x0F, ahead = (counter - m->last + COUNTER_MODULO) % COUNTER_MODULO;
    return crc == f->data[0] && counter < COUNTER_MODULO && (m->last < 0 || (ahead >= 1 && ahead <= 1 + MAX_LOST));
}

static bool is_sound(const wrcd_lane_message *m, const uint64_t *oks, uint64_t number)
{
    bool found = m->status_bits == 0;

    for (int k = 0; !found && k < m->oks; k++)
        found = oks[m->first_ok + k] == (number & m->status_bits);
    return found;
}

static double value_of(const wrcd_lane_signal *s, uint64_t number, double *physical)
{
    int64_t raw = (int64_t)(number >> s->shift & s->mask);

    if ((uint64_t)raw & s->sign)
        raw -= (int64_t)(s->sign << 1);
    *physical = (double)raw * s->scale + s->offset;
    return *physical * s->factor;
}

/* Whether a value is one that nothing speaks against. */
static bool is_plausible(const wrcd_lane *k, const wrcd_lane_signal *s, double physical, double value, double speed,
                         int64_t stamp_us)
{
    if (!(physical >= s->low && physical <= s->high))
        return false;
    if (s->quantity <= LAT && !(s->first_end < value && value < s->last_end))
        return false;
    if (s->check == WRCD_STUCK_CHECKED)
        return !(value == s->value && speed >= k->min_speed_m_s) || s->run + 1 < WRCD_MIN_RUN;
    if (s->quantity == SPEED && k->speed_tells_direction && fabs(value) > BACKWARDS_M_S
        && (value < 0.0) != (k->is_reverse != 0))
        return false;
    if (s->check == WRCD_JUMP_CHECKED) {
        const int64_t age_us = stamp_us - s->changed_us;
        return !(age_us <= s->timeout_us && fabs(value - s->value) > s->max_step * fmax(1.0, (double)age_us / JUMP_US));
    }
    return true;
}

static void learn(wrcd_lane_signal *s, double value, double speed, double min_speed_m_s, int64_t stamp_us)
{
    if (s->check == WRCD_STUCK_CHECKED && value == s->value && speed >= min_speed_m_s) {
        s->run++;
        return;
    }
    if (s->check == WRCD_STUCK_CHECKED && value != s->value && s->first_end < s->value && s->value < s->last_end) {
        for (int repeats = s->run; repeats >= 0; repeats--) {
            s->frames = fmin(s->frames + 1.0, MAX_FRAMES);
            s->share += ((repeats > 0 ? 1.0 : 0.0) - s->share) / s->frames;
        }
    }
    s->run = 0;
    s->value = value;
    s->changed_us = stamp_us;
}

int wrcd_lane_reach(wrcd_lane_place *p, int64_t us)
{
    if (us >= p->reach_until_us) {
        const int64_t timeout_us = p->timeout_us > 0 ? p->timeout_us : 1, interval = us / timeout_us;
        const int64_t passed = interval + 1 - p->reach_until_us / timeout_us;
        p->reach = passed > REACH_BITS ? 0 : p->reach << passed & ((1 << (REACH_BITS + 1)) - 1);
        p->reach_until_us = (interval + 1) * timeout_us;
    }
    return p->reach >> 1;
}

static void accept(wrcd_lane *k, const wrcd_lane_tables *t, const wrcd_lane_signal *s, double value, int64_t stamp_us)
{
    for (int i = 0; i < s->places; i++) {
        wrcd_lane_place *p = &t->place[t->places[s->first_place + i]];
        p->stamp_us = stamp_us;
        (void)wrcd_lane_reach(p, stamp_us);
        p->reach |= 1;
        if (s->quantity > LAT) {
            p->value = value;
        } else {
            if (p->waits == 2) { /* a third drops the oldest */
                p->waiting[0] = p->waiting[1];
                p->waiting_us[0] = p->waiting_us[1];
                p->waits = 1;
            }
            p->waiting[p->waits] = value;
            p->waiting_us[p->waits++] = stamp_us;
        }
        if (s->quantity == TORQUE && k->torque_sign_counts && value > k->dead_Nm)
            p->traction_us = stamp_us;
    }
    if (s->quantity > LAT) {
        k->ratio_known = 0;
        if (s->quantity != SPEED && (s->quantity != TORQUE || k->torque_sign_counts))
            k->shares_known = 0;
    }
}

/* Take a frame of a plain message; false, and nothing has changed, if anything speaks against it. */
static bool take(wrcd_lane *k, const wrcd_lane_tables *t, wrcd_lane_message *m, const wrcd_frame *f)
{
    if (!m->is_plain || (f->word & (CAN_REMOTE | CAN_ERROR)) || f->length != m->length || f->stamp_us < k->begin_us)
        return false;
    const uint64_t number = whole_number(f->data, m->length, m->is_big_endian != 0);
    if (!is_intact(m, f, t->crc_table) || !is_sound(m, t->oks, number))
        return false;
    wrcd_lane_signal *first = &t->signal[m->first_signal];
    const double speed = fabs(at(t->place, k, SPEED, 0)->value);
    for (int i = 0; i < m->signals; i++) {
        double physical;
        const double value = value_of(&first[i], number, &physical);
        if (!is_plausible(k, &first[i], physical, value, speed, f->stamp_us))
            return false;
    }
    for (int i = 0; i < m->signals; i++) {
        double physical;
        const double value = value_of(&first[i], number, &physical);
        learn(&first[i], value, speed, k->min_speed_m_s, f->stamp_us);
        accept(k, t, &first[i], value, f->stamp_us);
    }
    if (m->is_protected) {
        m->last = f->data[1] & 0x0F;
        memcpy(m->payload, f->data, sizeof m->payload);
        m->last_us = f->stamp_us;
        m->frames++;
    }
    k->accepted++;
    return true;
}

/* Whether nothing speaks against the open tick. */
static bool tick_is_sound(wrcd_lane *k, const wrcd_lane_tables *t, int signals)
{
    wrcd_lane_place *place = t->place;
    const int64_t end_us = k->begin_us + k->period_us;
    const double speed = fabs(at(place, k, SPEED, 0)->value);
    const int count = WRCD_QUANTITIES * k->axles;

    if (end_us - k->stamp_us > k->silence_us || !(speed >= k->min_speed_m_s) || !(speed >= k->speed_low_m_s)
        || !(speed <= k->speed_high_m_s))
        return false;
    for (int p = 0; p < count; p++)
        if (place[p].is_mapped && end_us - place[p].stamp_us > place[p].timeout_us)
            return false;
    for (int i = 0; i < signals; i++)
        if (t->signal[i].run >= WRCD_MIN_RUN)
            return false;
    for (int axle = 0; !k->shares_known && axle < k->axles; axle++) {
        const wrcd_lane_place *torque = at(place, k, TORQUE, axle);
        const wrcd_lane_place *brakes = at(place, k, BRAKE, axle);
        const double brake = brakes->value, load = at(place, k, LOAD, axle)->value / k->load_N;
        const double radius = at(place, k, RADIUS, axle)->value / k->radius_m;
        if (fmin(torque->value, brake) < -k->against_Nm && fmax(torque->value, brake) > k->against_Nm)
            return false;
        if (!(k->torque_is_total || brakes->is_mapped || torque->value > 0.0)
            && (torque->value < -k->dead_Nm || torque->stamp_us - torque->traction_us > k->traction_held_us))
            return false;
        if (!(load >= k->shares[0] && load <= k->shares[1] && radius >= k->shares[2] && radius <= k->shares[3]))
            return false;
    }
    k->shares_known = 1;
    return true;
}

/* Close the open tick: each axle's measurements, the torque, the bank. Returns what the estimator says. */
static int close_tick(wrcd_lane *k, const wrcd_lane_tables *t, wrcd_estimator *e, const wrcd_design *design,
                      wrcd_result *result)
{
    wrcd_lane_place *place = t->place;
    const int n = k->axles;
    double *z = k->z;
    uint8_t present[WRCD_CHANNELS * WRCD_MAX_AXLES];

    for (int i = 0; i < WRCD_CHANNELS * n; i++) {
        wrcd_lane_place *p = &place[i];
        present[i] = p->waits > 0 && !isnan(p->waiting[0]);
        z[i] = present[i] ? p->waiting[0] : 0.0;
        p->used_us = present[i] ? p->waiting_us[0] : p->used_us;
        if (p->waits > 0) {
            p->waiting[0] = p->waiting[1];
            p->waiting_us[0] = p->waiting_us[1];
            p->waits--;
        }
        p->surplus_ticks = p->waits > 0 ? p->surplus_ticks + 1 : 0;
        if (p->surplus_ticks >= k->patience) /* it has kept others waiting, and was never needed */
            p->waits = p->surplus_ticks = 0;
        if (i >= n && k->is_reverse) /* seen in the direction of travel left is right */
            z[i] *= at(place, k, DIRECTION, i - n)->value;
    }
    for (int axle = 0; !k->ratio_known && axle < n; axle++) {
        const double torque = at(place, k, TORQUE, axle)->value + at(place, k, BRAKE, axle)->value; /* none: 0 */
        k->torque_ratio[axle] = fabs(torque) / (at(place, k, LOAD, axle)->value * at(place, k, RADIUS, axle)->value);
    }
    k->ratio_known = 1;
    const wrcd_tick tick = {k->open, fabs(at(place, k, SPEED, 0)->value), z, present, k->torque_ratio};
    const int says = wrcd_step(e, design, &tick, result);
    k->open++;
    k->ticks++;
    k->begin_us = k->open * k->period_us;
    k->end_us = k->begin_us + k->period_us;
    for (int axle = 0; axle < n; axle++)
        k->sound_ticks[axle]++;
    k->due = 0;
    for (int i = 0; i < k->cycles; i++)
        if (k->begin_us % k->cycle_us[i] < k->period_us)
            k->due |= 1 << i;
    return says;
}

/* Close ticks up to one, until something happens that Python has to know. */
static int close_up_to(wrcd_lane *k, const wrcd_lane_tables *t, int signals, wrcd_estimator *e,
                       const wrcd_design *design, wrcd_result *result, int64_t target)
{
    while (k->open < target) {
        if (!tick_is_sound(k, t, signals))
            return WRCD_TICK;
        const int says = close_tick(k, t, e, design, result);
        if (says)
            return WRCD_NOTE;
        if (k->due && !((k->due & ~k->quiet) == 0 && wrcd_lane_tell(k, t, e, design)))
            return WRCD_SLOT;
    }
    return WRCD_ALL_TAKEN;
}

static int signals_of(const wrcd_lane *k, const wrcd_lane_tables *t)
{
    int count = 0;

    for (int i = 0; i < k->messages; i++)
        count += t->message[i].signals;
    return count;
}

int wrcd_lane_run(wrcd_lane *k, const wrcd_lane_tables *t, wrcd_estimator *e, const wrcd_design *design,
                  wrcd_result *result, const wrcd_frame *frame, int64_t frames, int64_t *taken)
{
    const int signals = signals_of(k, t);

    for (; *taken < frames; ++*taken) {
        const wrcd_frame *f = &frame[*taken];
        wrcd_lane_message *m = f->word & CAN_ERROR ? NULL : message_of(k, t, f->word & ~CAN_REMOTE);
        if (m == NULL)
            continue;
        if (!(k->begin_us <= k->stamp_us && k->stamp_us <= f->stamp_us && f->stamp_us < k->end_us)) {
            if (f->stamp_us - k->begin_us > k->forward_step_us || k->stamp_us - f->stamp_us > k->backward_step_us)
                return WRCD_FRAME;
            const int stop = close_up_to(k, t, signals, e, design, result, f->stamp_us / k->period_us);
            if (stop != WRCD_ALL_TAKEN)
                return stop;
        }
        if (!take(k, t, m, f))
            return WRCD_FRAME;
        k->stamp_us = f->stamp_us > k->stamp_us ? f->stamp_us : k->stamp_us;
    }
    return WRCD_ALL_TAKEN;
}

/* Bytes of the records, for a check of who else lays them out. */
int wrcd_lane_bytes(int of)
{
    const size_t bytes[] = {sizeof(wrcd_frame), sizeof(wrcd_lane_message), sizeof(wrcd_lane_signal),
                            sizeof(wrcd_lane_place), sizeof(wrcd_lane), sizeof(wrcd_lane_sent),
                            sizeof(wrcd_lane_field), sizeof(wrcd_lane_slot)};

    return (int)bytes[of];
}
