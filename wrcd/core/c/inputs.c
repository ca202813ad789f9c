/* The measurements of every axle, and how old each is. A new input begins here and in the lists of quantities
 * (wrcd.h, wrcd/bus/units.py): what a tick takes of it is in wrcd_inputs_close(), what speaks against it in validity.c. */
#include "core.h"

enum { REACH_BITS = 8 };
/* Torques against each other by more than this share of 2 N r_0 contradict each other. A motor's torque is estimated, a
 * brake's follows from its pressure: either is wrong by up to that much where it should be nothing, and where less cancels,
 * MuUsed is wrong by less than four percentage points. */
static const double AGAINST_SHARE = 0.02;
static const double BACKWARDS_M_S = 0.5; /* a speed further below zero is of a train in reverse */

static double torque_at_full_load_Nm(const wrcd_train *t) { return t->settings->load_N * t->settings->radius_m; }

static const wrcd_input *input_of(const wrcd_train *t, int quantity, int axle)
{
    const int number = t->settings->input_of[quantity][axle];

    return number < 0 ? NULL : &t->input[number];
}

static wrcd_input_state *state_of(const wrcd_train *t, const wrcd_input *i) { return &t->input_state[i - t->input]; }

static const wrcd_input *next_of(const wrcd_train *t, const wrcd_input *i) { return i->next < 0 ? NULL : &t->input[i->next]; }

/* The newest value of a quantity, of several signals that add up the first's; where none is mapped, what counts instead. */
double wrcd_value_of(const wrcd_train *t, int quantity, int axle)
{
    const wrcd_input *i = input_of(t, quantity, axle);

    if (i != NULL)
        return state_of(t, i)->value;
    return quantity == WRCD_DIRECTION && t->settings->speed_tells_direction && t->core->is_reverse
        ? -1.0 : t->settings->start[quantity];
}

/* The sum of all signals that a quantity of an axle is made of. */
double wrcd_total_of(const wrcd_train *t, int quantity, int axle)
{
    const wrcd_input *i = input_of(t, quantity, axle);
    double total = wrcd_value_of(t, quantity, axle);

    while (i != NULL && (i = next_of(t, i)) != NULL)
        total += state_of(t, i)->value;
    return total;
}

/* Whether torque and brake torque are against each other, or two parts of the torque. One of them has the wrong sign, and
 * their sum would be what is left of either. */
bool wrcd_torques_contradict(const wrcd_train *t, int axle)
{
    const double most = AGAINST_SHARE * torque_at_full_load_Nm(t), torque = wrcd_total_of(t, WRCD_TORQUE, axle);
    const double brake = wrcd_total_of(t, WRCD_BRAKE, axle);
    double least = INFINITY, largest = -INFINITY;

    for (const wrcd_input *i = input_of(t, WRCD_TORQUE, axle); i != NULL; i = next_of(t, i)) {
        least = fmin(least, state_of(t, i)->value);
        largest = fmax(largest, state_of(t, i)->value);
    }
    return (least < -most && largest > most) || (fmin(torque, brake) < -most && fmax(torque, brake) > most);
}

/* How large the torque at an axle is: where its parts contradict each other, as large as the larger side. */
static double torque_Nm(const wrcd_train *t, int axle)
{
    static const int OF[2] = {WRCD_TORQUE, WRCD_BRAKE};
    double driving = 0.0, braking = 0.0;

    if (!t->settings->torque_sign_counts || !wrcd_torques_contradict(t, axle))
        return fabs(wrcd_total_of(t, WRCD_TORQUE, axle) + wrcd_total_of(t, WRCD_BRAKE, axle));
    for (int k = 0; k < 2; k++)
        for (const wrcd_input *i = input_of(t, OF[k], axle); i != NULL; i = next_of(t, i)) {
            driving += fmax(state_of(t, i)->value, 0.0);
            braking += fmin(state_of(t, i)->value, 0.0);
        }
    return fmax(driving, -braking);
}

/* Whether the friction brakes may add what no signal has: always but in traction, torque 0 included. What is as good as 0
 * just after traction is still traction. */
bool wrcd_friction_share_unknown(const wrcd_train *t, int axle)
{
    const double torque = wrcd_total_of(t, WRCD_TORQUE, axle);
    int64_t newest_us = WRCD_NEVER;

    if (t->settings->torque_is_total || input_of(t, WRCD_BRAKE, axle) != NULL || torque > 0.0)
        return false;
    for (const wrcd_input *i = input_of(t, WRCD_TORQUE, axle); i != NULL; i = next_of(t, i))
        newest_us = state_of(t, i)->stamp_us > newest_us ? state_of(t, i)->stamp_us : newest_us;
    return torque < -DEAD_SHARE * torque_at_full_load_Nm(t) || newest_us - t->axle[axle].traction_us > TRACTION_HELD_US;
}

/* Move a register on to a time. */
static void reach_to(const wrcd_input *i, wrcd_input_state *s, int64_t us)
{
    const int64_t timeout_us = i->timeout_us > 0 ? i->timeout_us : 1;

    if (us < s->reach_until_us)
        return;
    const int64_t interval = divided(us, timeout_us), passed = interval + 1 - divided(s->reach_until_us, timeout_us);
    s->reach = passed > REACH_BITS ? 0 : s->reach << passed & ((1 << (REACH_BITS + 1)) - 1);
    s->reach_until_us = (interval + 1) * timeout_us;
}

static int bits_set(int bits)
{
    int count = 0;

    for (; bits != 0; bits &= bits - 1)
        count++;
    return count;
}

/* How well a quantity is reached: a bit for each time-out that is over, set: a good frame came in it; and the newest reason
 * of a refusal among them. Of several signals that add up, of the one that is reached least. */
int wrcd_reached(const wrcd_train *t, int quantity, int axle, int64_t end_us, int *refused)
{
    int least = 0, fewest = REACH_BITS + 1;

    *refused = WRCD_REASON_NONE;
    for (const wrcd_input *i = input_of(t, quantity, axle); i != NULL; i = next_of(t, i)) {
        wrcd_input_state *s = state_of(t, i);
        reach_to(i, s, end_us);
        const int64_t timeout_us = i->timeout_us > 0 ? i->timeout_us : 1;
        const int why = end_us - s->rejected_us <= REACH_BITS * timeout_us ? s->rejected : WRCD_REASON_NONE;
        const int set = bits_set(s->reach >> 1);
        if (set < fewest || (set == fewest && *refused == WRCD_REASON_NONE && why != WRCD_REASON_NONE)) {
            least = s->reach >> 1;
            fewest = set;
            *refused = why;
        }
    }
    return least;
}

/* A measurement for a tick; NaN: one that is not to be used, and has its tick all the same. A third drops the oldest. */
static void put(wrcd_input_state *s, double value, int64_t stamp_us)
{
    if (s->waits == 2) {
        s->waiting[0] = s->waiting[1];
        s->waiting_us[0] = s->waiting_us[1];
        s->waits = 1;
    }
    s->waiting[s->waits] = value;
    s->waiting_us[s->waits++] = stamp_us;
}

/* Give a tick one measurement of a channel, in the order in which they came; false: it has none.
 *
 * A sensor's cycle and the tick are equal and drift against each other; with the bus's jitter, frames near a tick's edge
 * come two to one tick and none to the next. So one measurement may wait for the next tick: after the first such pair none
 * is lost and no tick is empty. More than one never waits, so that a measurement is used at most one tick late, and a
 * sensor twice as fast as the tick has every second one used. One that has kept others waiting for `patience` ticks on
 * end, and was never needed, is dropped: two channels that are a tick apart are no longer of the same moment. */
static bool take(wrcd_input_state *s, int patience, double *z)
{
    const bool came = s->waits > 0, is_there = came && !isnan(s->waiting[0]);

    *z = is_there ? s->waiting[0] : 0.0;
    if (is_there)
        s->used_us = s->waiting_us[0];
    if (came) {
        s->waiting[0] = s->waiting[1];
        s->waiting_us[0] = s->waiting_us[1];
        s->waits--;
    }
    s->surplus_ticks = s->waits > 0 ? s->surplus_ticks + 1 : 0;
    if (s->surplus_ticks >= patience)
        s->waits = s->surplus_ticks = 0;
    return is_there;
}

/* A value of an accepted frame. Returns whether it is clipped: a measurement at an end of its range, which is there in
 * time, and which no tick uses, for nobody knows how much larger the truth is. */
bool wrcd_accept(const wrcd_train *t, const reading *v, int64_t stamp_us)
{
    const wrcd_input *i = &t->input[v->input];
    wrcd_input_state *s = &t->input_state[v->input];
    const bool is_measured = i->quantity <= WRCD_LAT;
    const bool is_clipped = is_measured && !(i->first_end < v->value && v->value < i->last_end);

    s->stamp_us = stamp_us;
    reach_to(i, s, stamp_us);
    s->reach |= 1;
    s->is_degraded = v->is_degraded;
    s->is_contested = v->is_contested;
    s->clipped += is_clipped;
    if (is_measured)
        put(s, is_clipped ? NAN : v->value, stamp_us);
    else
        s->value = v->value;
    if (i->quantity == WRCD_SPEED && t->settings->speed_tells_direction && fabs(v->value) > BACKWARDS_M_S)
        t->core->is_reverse = v->value < 0.0;
    for (int axle = 0; i->quantity == WRCD_TORQUE && t->settings->torque_sign_counts && axle < t->settings->axles; axle++)
        if (has(i->axles, axle) && wrcd_total_of(t, WRCD_TORQUE, axle) > DEAD_SHARE * torque_at_full_load_Nm(t))
            t->axle[axle].traction_us = stamp_us;
    return is_clipped;
}

/* A frame of an input was refused. Where two senders contradict each other, not even what came before holds. */
void wrcd_reject(const wrcd_train *t, int input, int64_t stamp_us, int reason)
{
    wrcd_input_state *s = &t->input_state[input];

    s->rejected = reason;
    s->rejected_us = stamp_us;
    if (s->refused_since_us != s->stamp_us) {
        s->refused_since_us = s->stamp_us;
        memset(s->refused, 0, sizeof s->refused);
        s->refusals = 0;
    }
    if (s->refused[reason]++ == 0)
        s->order[s->refusals++] = (uint8_t)reason;
    if (reason == WRCD_REASON_TWO_SENDERS)
        s->is_contested = 1;
}

/* A step of time, or a long silence: nothing that came before counts. */
void wrcd_inputs_reset(const wrcd_train *t)
{
    t->core->speed_jumped = 0;
    for (int axle = 0; axle < t->settings->axles; axle++)
        t->axle[axle].traction_us = WRCD_NEVER;
    for (int k = 0; k < t->settings->inputs; k++) {
        wrcd_input_state *s = &t->input_state[k];
        s->stamp_us = s->used_us = s->reach_until_us = s->rejected_us = s->refused_since_us = WRCD_NEVER;
        s->waits = s->surplus_ticks = s->reach = s->refusals = 0;
        memset(s->refused, 0, sizeof s->refused);
        wrcd_plausibility_reset(s);
    }
}

void wrcd_inputs_begin(const wrcd_train *t)
{
    for (int k = 0; k < t->settings->inputs; k++)
        t->input_state[k].value = t->input[k].start;
    wrcd_inputs_reset(t);
}

/* A tick is over: what there is at its end. */
void wrcd_inputs_close(const wrcd_train *t, int64_t end_us, tick_inputs *tick)
{
    const int n = t->settings->axles;
    int32_t unknown = 0;

    memset(tick, 0, sizeof *tick);
    for (int axle = 0; axle < n; axle++)
        t->axle[axle].stale = 0;
    for (int k = 0; k < t->settings->inputs; k++) {
        const wrcd_input *i = &t->input[k];
        wrcd_input_state *s = &t->input_state[k];
        const int q = i->quantity;
        double z = 0.0;
        const bool is_there = q <= WRCD_LAT && take(s, t->settings->recent_ticks, &z);
        for (int axle = 0; q <= WRCD_LAT && axle < n; axle++)
            if (has(i->axles, axle)) {
                tick->z[q * n + axle] = z;
                tick->present[q * n + axle] = is_there;
            }
        if (end_us - s->stamp_us <= i->timeout_us)
            continue;
        tick->stale |= i->axles;
        for (int axle = 0; axle < n; axle++)
            if (has(i->axles, axle))
                t->axle[axle].stale |= 1 << q;
        if (end_us - s->stamp_us > i->silent_us) {
            tick->silent |= i->axles;
            if (q == WRCD_TORQUE || q == WRCD_BRAKE || q == WRCD_LOAD || q == WRCD_RADIUS)
                unknown |= i->axles;
        }
    }
    for (int axle = 0; axle < n; axle++) {
        /* seen in the direction of travel left is right; counter-clockwise stays so */
        tick->z[n + axle] *= wrcd_value_of(t, WRCD_DIRECTION, axle);
        const double grip = wrcd_total_of(t, WRCD_LOAD, axle) * wrcd_value_of(t, WRCD_RADIUS, axle);
        tick->torque_ratio[axle] = has(unknown, axle) ? NAN : torque_Nm(t, axle) / grip;
        t->axle[axle].torque_ratio = tick->torque_ratio[axle];
    }
    tick->speed_m_s = wrcd_value_of(t, WRCD_SPEED, 0);
}

/* Age of the oldest of gyro, acceleration, torque (the friction brakes' is part of it) and speed, up to 255. Load, radius
 * and direction may come once a second. */
int wrcd_age_ms(const wrcd_train *t, int axle, int64_t end_us)
{
    int64_t oldest_us = INT64_MAX;

    for (int q = WRCD_YAW; q <= WRCD_BRAKE; q++)
        for (const wrcd_input *i = input_of(t, q, axle); i != NULL; i = next_of(t, i)) {
            const int64_t came_us = q <= WRCD_LAT ? state_of(t, i)->used_us : state_of(t, i)->stamp_us;
            oldest_us = came_us < oldest_us ? came_us : oldest_us;
        }
    const int64_t age_ms = divided(end_us - oldest_us, 1000);
    return age_ms < 255 ? (int)age_ms : 255;
}

/* Whether any sensor of an axle stands still. */
bool wrcd_any_unchanged(const wrcd_train *t, int axle, int64_t end_us)
{
    for (int q = WRCD_YAW; q <= WRCD_LAT; q++) {
        const wrcd_input *i = input_of(t, q, axle);
        if (i != NULL && wrcd_is_unchanged(t, (int)(i - t->input), end_us))
            return true;
    }
    return false;
}
