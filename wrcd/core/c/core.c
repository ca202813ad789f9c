/* frame -> values -> inputs -> tick -> estimate -> Validity with its cause -> frames, on the frames' own time stamps.
 *
 * The core reads no clock. Live, the loop gives it how far time has come (advance); in a replay the next frame does. Tick k
 * owns the frames stamped in [k P, (k + 1) P); of two measurements one may wait for the next tick, of every other signal the
 * newest counts. Frames of a slot are made when the tick that ends it is closed.
 *
 * A stamp contradicts the clock if it is more than a second ahead of the open tick, which the clock drives, or behind the
 * newest stamp: a step of time. It is counted, nothing that was known before it holds, and no slot between is made. A
 * silence is none: its ticks are closed as the clock goes on. But after a second of it nothing holds either, so that
 * silence and step leave the same behind them, and whoever cannot distinguish them, as a replay, goes on alike. */
#include "fit.h"

enum {
    SILENCE_US = 1000000, /* without a mapped frame */
    EVENTS_OF_A_TICK = 3 /* of an axle: a cause, a restart, a change */ };

static void reset_axle(const wrcd_train *t, int axle, int why)
{
    wrcd_axle_state *a = &t->axle[axle];

    if (!a->is_reset) {
        wrcd_reset(t->estimator, t->design, axle);
        t->core->were_reset |= 1 << axle;
    }
    a->is_reset = 1;
    wrcd_validity_reset(a, why);
}

/* Nothing that was known before holds. */
static void reset_all(const wrcd_train *t)
{
    t->core->stamp_us = WRCD_NEVER;
    wrcd_inputs_reset(t);
    for (int k = 0; k < t->settings->bogies; k++)
        wrcd_fit_reset(&t->bogie[k]);
    wrcd_forget_senders(t);
    for (int axle = 0; axle < t->settings->axles; axle++) {
        wrcd_axle_state *a = &t->axle[axle];
        a->outlier_us = a->waits_until = WRCD_NEVER;
        a->resets_in_a_row = 0;
        reset_axle(t, axle, WRCD_CAUSE_WARMING_UP);
    }
}

void wrcd_core_begin(const wrcd_train *t)
{
    const wrcd_settings *s = t->settings;

    memset(t->core, 0, sizeof *t->core);
    memset(t->message_state, 0, (size_t)s->messages * sizeof *t->message_state);
    memset(t->input_state, 0, (size_t)s->inputs * sizeof *t->input_state);
    memset(t->status_state, 0, (size_t)s->statuses * sizeof *t->status_state);
    memset(t->axle, 0, (size_t)s->axles * sizeof *t->axle);
    memset(t->bogie, 0, (size_t)s->bogies * sizeof *t->bogie);
    wrcd_begin(t->estimator, t->design, s->axles);
    for (int axle = 0; axle < s->axles; axle++) {
        t->axle[axle].is_reset = 1;
        t->estimator->partner[axle] = s->partner[axle];
    }
    t->core->begin_us = t->core->end_us = WRCD_NEVER;
    wrcd_inputs_begin(t);
    reset_all(t);
}

static void restart(const wrcd_train *t, int axle, int64_t number)
{
    t->core->restarts++;
    wrcd_backoff_was_reset(t, &t->axle[axle], number);
}

/* Tell an axle's Validity of a tick; reset the axle if it does not run in it. */
static void begin_tick(const wrcd_train *t, wrcd_out *out, int axle, int64_t number, const tick_inputs *tick, bool runs)
{
    wrcd_axle_state *a = &t->axle[axle];

    if (t->core->speed_jumped && !a->is_reset) { /* confirmed: it is another source's, and so may all else be */
        restart(t, axle, number);
        wrcd_tell_jump(t, out, axle, t->core->end_us);
    }
    if (runs) {
        a->is_reset = 0;
        wrcd_validity_update(a, t->settings->window_ticks, a->tick_cause);
        if (a->sound_ticks < t->settings->window_ticks)
            wrcd_slides_forget(t->estimator, axle);
        a->resets_in_a_row = a->window_full ? 0 : a->resets_in_a_row;
    } else if (has(tick->silent, axle)) {
        reset_axle(t, axle, WRCD_CAUSE_INPUT_SILENT);
    } else {
        const bool again = t->core->speed_jumped || number < a->waits_until;
        reset_axle(t, axle, again ? WRCD_CAUSE_RESTARTED : WRCD_CAUSE_STANDSTILL);
    }
}

/* Remember whose measurements were left out in a tick, and reset the axles that need it. */
static void note_outliers(const wrcd_train *t, wrcd_out *out, int64_t number, const tick_inputs *tick)
{
    for (int axle = 0; axle < t->settings->axles; axle++)
        if (t->result->outliers[axle])
            t->axle[axle].outlier_us = t->core->end_us;
    for (int axle = 0; axle < t->settings->axles; axle++)
        if (t->result->needs_reset[axle]) {
            restart(t, axle, number);
            const double wait_s = wrcd_backoff_wait_s(t, &t->axle[axle], number);
            wrcd_tell_outliers(t, out, axle, tick->z[axle], wait_s, t->core->end_us);
            reset_axle(t, axle, WRCD_CAUSE_RESTARTED);
        }
}

/* The estimator counts ticks from 0 on. So many before 1970, 4000 years of ticks of a millisecond, are whole turns of all
 * that goes by a tick's number. */
static int64_t before_all(const wrcd_train *t)
{
    const int64_t turn = (int64_t)SPAN_TICKS * WRCD_BLOCK_TICKS * t->design->longest;

    return (((int64_t)1 << 47) / turn + 1) * turn;
}

/* Look whether the design is this train's. Backwards the other wheelset of a bogie leads. */
static void look_at_bogies(const wrcd_train *t, int64_t number, double speed_m_s, const tick_inputs *tick)
{
    const int n = t->settings->axles;

    for (int k = 0; k < t->settings->bogies; k++) {
        double z[WRCD_FIT_SIGNALS];
        bool is_there[WRCD_FIT_SIGNALS];
        const int32_t *axles = t->settings->axles_of + 2 * (ptrdiff_t)k;
        const bool is_reverse = wrcd_value_of(t, WRCD_DIRECTION, axles[0]) < 0.0;
        for (int i = 0; i < WRCD_FIT_SIGNALS; i++) {
            const int at = i % WRCD_CHANNELS * n + axles[i / WRCD_CHANNELS != is_reverse];
            z[i] = tick->z[at];
            is_there[i] = tick->present[at];
        }
        wrcd_fit_step(t->fit, &t->bogie[k], is_reverse, number, z, is_there, speed_m_s);
    }
}

/* Run the bank on a tick: the axles that have what they need, and need not wait. */
static void run_tick(const wrcd_train *t, wrcd_out *out, int64_t number, tick_inputs *tick)
{
    const int n = t->settings->axles;
    const double speed = fabs(tick->speed_m_s);
    const bool may_run = speed >= t->settings->min_speed_m_s && !t->core->speed_jumped;
    bool any = false;

    for (int axle = 0; axle < n; axle++) {
        const bool runs = may_run && !has(tick->silent, axle) && number >= t->axle[axle].waits_until;
        begin_tick(t, out, axle, number, tick, runs);
        tick->present[axle] = tick->present[axle] && runs;
        tick->present[n + axle] = tick->present[n + axle] && runs;
        any = any || runs;
    }
    t->core->speed_jumped = 0;
    if (!any)
        return;
    const wrcd_tick now = {number + before_all(t), speed, tick->z, tick->present, tick->torque_ratio};
    const int says = wrcd_step(t->estimator, t->design, &now, t->result);
    look_at_bogies(t, number, speed, tick);
    const int32_t were_reset = t->core->were_reset;
    t->core->were_reset = 0;
    if (t->core->keeps_ticks) {
        wrcd_tick_seen *seen = &out->tick[out->counts[WRCD_OUT_TICKS]++];
        *seen = (wrcd_tick_seen){
            .number = number, .speed_m_s = speed, .were_reset = were_reset, .result = *t->result};
        for (int axle = 0; axle < n; axle++) {
            seen->torque_ratio[axle] = tick->torque_ratio[axle];
            for (int c = 0; c < WRCD_CHANNELS; c++) {
                seen->z[c][axle] = tick->z[c * n + axle];
                seen->present[c][axle] = tick->present[c * n + axle];
            }
        }
    }
    if (says)
        note_outliers(t, out, number, tick);
}

/* What speaks against the tick, and how it is where that is another thing than before. */
static void find_causes(const wrcd_train *t, wrcd_out *out, const tick_inputs *tick)
{
    int32_t cause[WRCD_MAX_AXLES];

    wrcd_tick_causes(t, tick, t->core->end_us, cause);
    for (int axle = 0; axle < t->settings->axles; axle++) {
        if (cause[axle] != WRCD_CAUSE_NONE && cause[axle] != t->axle[axle].tick_cause)
            wrcd_tell_cause(t, out, axle, cause[axle], t->core->end_us);
        t->axle[axle].tick_cause = cause[axle];
    }
}

/* Close the open tick. */
static void close_tick(const wrcd_train *t, wrcd_out *out)
{
    wrcd_core_state *c = t->core;
    const int64_t number = c->open;
    tick_inputs tick;

    c->ticks++;
    c->end_us = (number + 1) * t->settings->period_us;
    if (c->stamp_us != WRCD_NEVER && c->end_us - c->stamp_us > SILENCE_US)
        reset_all(t);
    wrcd_inputs_close(t, c->end_us, &tick);
    find_causes(t, out, &tick);
    run_tick(t, out, number, &tick);
    c->open++;
    if (!c->is_muted)
        wrcd_slot(t, out, c->end_us);
}

/* Whether the buffers have room for what a tick and a frame may bring. */
static bool has_room(const wrcd_train *t, const wrcd_out *out)
{
    const int64_t n = t->settings->axles, needs[WRCD_OUT_KINDS] = {
        t->settings->sent, n, EVENTS_OF_A_TICK * n, t->core->keeps_samples ? t->settings->inputs : 0, t->core->keeps_ticks};

    for (int k = 0; k < WRCD_OUT_KINDS; k++)
        if (out->counts[k] + needs[k] > out->most[k])
            return false;
    return true;
}

/* Close the ticks before one. Returns whether all are. */
static bool close_up_to(const wrcd_train *t, wrcd_out *out, int64_t target)
{
    wrcd_core_state *c = t->core;

    while (c->open < target && has_room(t, out))
        close_tick(t, out);
    c->begin_us = c->open * t->settings->period_us;
    c->end_us = c->begin_us + t->settings->period_us;
    return c->open >= target && has_room(t, out);
}

/* Go on to a tick; with `steps`, a step of time, with nothing from before. */
static bool move_to(const wrcd_train *t, wrcd_out *out, int64_t target, bool steps)
{
    if (steps) {
        t->core->time_steps++;
        t->core->open = target;
        reset_all(t);
    }
    return close_up_to(t, out, target);
}

static void open_at(wrcd_core_state *c, int64_t tick)
{
    c->open = c->is_open ? c->open : tick;
    c->is_open = 1;
}

/* Close the ticks before a stamp. Returns whether all are. */
static bool go_to_stamp(const wrcd_train *t, wrcd_out *out, int64_t stamp_us)
{
    wrcd_core_state *c = t->core;
    bool all = true;

    if (!(c->begin_us <= c->stamp_us && c->stamp_us <= stamp_us && stamp_us < c->end_us)) {
        const int64_t target = divided(stamp_us, t->settings->period_us);
        open_at(c, target);
        const int64_t begin_us = c->open * t->settings->period_us, newest_us = c->stamp_us == WRCD_NEVER ? begin_us : c->stamp_us;
        all = move_to(t, out, target, stamp_us - begin_us > FORWARD_STEP_US || newest_us - stamp_us > BACKWARD_STEP_US);
    }
    if (all && stamp_us > c->stamp_us)
        c->stamp_us = stamp_us;
    return all;
}

/* Count a frame that is refused, for the inputs that it carries, too. */
static void refuse(const wrcd_train *t, int message, const wrcd_frame_head *f, int reason)
{
    const wrcd_message *m = &t->message[message];

    t->message_state[message].refused[reason]++;
    t->core->refused++;
    t->core->last_reason = reason;
    for (int i = m->first_signals; i < m->first_signals + m->signals; i++)
        if (wrcd_is_concerned(t, m, i, f, reason))
            wrcd_reject(t, i, f->stamp_us, reason);
}

/* Take or refuse a frame, whole. */
static void take(const wrcd_train *t, wrcd_out *out, const wrcd_message *m, const wrcd_frame_head *f, int64_t room)
{
    const int message = (int)(m - t->message);
    reading values[WRCD_MAX_SIGNALS];
    int count, reason = wrcd_read_frame(t, message, f, room, values, &count);

    for (int k = 0, read = reason; read == WRCD_REASON_NONE && k < count; k++) {
        const int implausible = wrcd_plausible(t, &values[k], f->stamp_us);
        reason = reason == WRCD_REASON_NONE ? implausible : reason;
    }
    if (reason != WRCD_REASON_NONE) {
        refuse(t, message, f, reason);
        return;
    }
    t->core->accepted++;
    t->core->late += f->stamp_us < t->core->begin_us;
    for (int k = 0; k < count; k++) {
        wrcd_accept(t, &values[k], f->stamp_us);
        if (t->core->keeps_samples)
            out->sample[out->counts[WRCD_OUT_SAMPLES]++] = (wrcd_sample){
                f->stamp_us, values[k].value, values[k].input, 0, values[k].is_degraded, values[k].is_contested};
    }
}

int64_t wrcd_feed(const wrcd_train *t, wrcd_out *out, const unsigned char *records, int64_t stride, int64_t first,
                  int64_t frames)
{
    for (int64_t k = first; k < frames; k++) {
        const wrcd_frame_head *f = (const wrcd_frame_head *)(const void *)(records + k * stride);
        const wrcd_message *m = wrcd_message_of(t, f->word);
        if (m == NULL)
            continue;
        if (!go_to_stamp(t, out, f->stamp_us) || (t->core->keeps_samples && !has_room(t, out)))
            return k;
        take(t, out, m, f, stride - (int64_t)sizeof *f);
    }
    return frames;
}

int wrcd_advance(const wrcd_train *t, wrcd_out *out, int64_t now_us)
{
    wrcd_core_state *c = t->core;
    const int64_t target = divided(now_us, t->settings->period_us);

    open_at(c, target);
    const int64_t begin_us = c->open * t->settings->period_us, target_us = target * t->settings->period_us;
    return move_to(t, out, target, target_us - begin_us > FORWARD_STEP_US || begin_us - now_us > BACKWARD_STEP_US);
}

int64_t wrcd_next_slot_us(const wrcd_train *t)
{
    const int64_t period_us = t->settings->period_us, begin_us = t->core->open * period_us;
    int64_t next_us = INT64_MAX;

    if (!t->core->is_open)
        return WRCD_NEVER;
    for (int k = 0; k < t->settings->sent; k++) {
        const int64_t cycle_us = t->sent[k].cycle_us, slot_us = (divided(begin_us, cycle_us) + 1) * cycle_us;
        const int64_t end_us = -divided(-slot_us, period_us) * period_us;
        next_us = end_us < next_us ? end_us : next_us;
    }
    return next_us;
}
