/* What happened, as small records. Words are made of them elsewhere (wrcd/core/details.py), with the figures that are
 * here by cause: speed (m/s), torque (N m), load (N), radius (m), ticks, shares. */
#include "core.h"

static wrcd_event *new_event(wrcd_out *out, int kind, int axle, int cause, int64_t time_us)
{
    wrcd_event *e = &out->event[out->counts[WRCD_OUT_EVENTS]++];

    memset(e, 0, sizeof *e);
    e->time_us = time_us;
    e->kind = kind;
    e->axle = axle;
    e->cause = cause;
    e->input[0] = e->input[1] = -1;
    return e;
}

/* An input that is concerned: the first two with their age, and what was refused since the newest good frame. */
static void name_input(const wrcd_train *t, wrcd_event *e, int input, int64_t end_us)
{
    const wrcd_input_state *s = &t->input_state[input];
    const int at = e->listed++;

    if (at >= 2)
        return;
    e->input[at] = input;
    e->age_us[at] = s->stamp_us == WRCD_NEVER ? WRCD_NEVER : end_us - s->stamp_us;
    if (s->refused_since_us == s->stamp_us) {
        e->refusals[at] = s->refusals;
        memcpy(e->refused[at], s->refused, sizeof e->refused[at]);
        memcpy(e->order[at], s->order, sizeof e->order[at]);
    }
}

static bool is_concerned(const wrcd_train *t, int input, int cause, int64_t end_us)
{
    const wrcd_input *i = &t->input[input];
    const wrcd_input_state *s = &t->input_state[input];

    switch (cause) {
    case WRCD_CAUSE_INPUT_SILENT: return end_us - s->stamp_us > i->silent_us;
    case WRCD_CAUSE_INPUT_STALE: return end_us - s->stamp_us > i->timeout_us;
    case WRCD_CAUSE_TWO_SENDERS: return s->is_contested;
    case WRCD_CAUSE_SENSOR_DEGRADED: return s->is_degraded;
    case WRCD_CAUSE_UNCHANGED: return wrcd_is_unchanged(t, input, end_us);
    default: return false;
    }
}

/* The inputs of an axle that a cause is about: the quantities in their order, then what adds up to one. */
static void name_inputs(const wrcd_train *t, wrcd_event *e, int64_t end_us)
{
    for (int part = 0; part < 2; part++)
        for (int q = 0; q < WRCD_QUANTITIES; q++) {
            int input = t->settings->input_of[q][e->axle];
            for (int k = 0; input >= 0; input = t->input[input].next, k++)
                if ((k > 0) == part && is_concerned(t, input, e->cause, end_us))
                    name_input(t, e, input, end_us);
        }
}

/* The first eight torques of an axle that are mapped, those of the brakes last. */
static void list_torques(const wrcd_train *t, wrcd_event *e)
{
    static const int OF[2] = {WRCD_TORQUE, WRCD_BRAKE};

    for (int k = 0; k < 2; k++)
        for (int input = t->settings->input_of[OF[k]][e->axle]; input >= 0 && e->listed < 8; input = t->input[input].next)
            e->number[e->listed++] = t->input_state[input].value;
}

/* How a cause that speaks against a tick is as it begins. */
void wrcd_tell_cause(const wrcd_train *t, wrcd_out *out, int axle, int cause, int64_t end_us)
{
    wrcd_event *e = new_event(out, WRCD_DETAIL_EVENT, axle, cause, end_us);

    switch (cause) {
    case WRCD_CAUSE_SPEED_OUT_OF_RANGE: e->number[0] = wrcd_value_of(t, WRCD_SPEED, 0); break;
    case WRCD_CAUSE_FRICTION_SHARE_UNKNOWN: e->number[0] = wrcd_total_of(t, WRCD_TORQUE, axle); break;
    case WRCD_CAUSE_LOAD_BEYOND: e->number[0] = wrcd_total_of(t, WRCD_LOAD, axle); break;
    case WRCD_CAUSE_RADIUS_BEYOND: e->number[0] = wrcd_total_of(t, WRCD_RADIUS, axle); break;
    case WRCD_CAUSE_TORQUES_CONTRADICT: list_torques(t, e); break;
    default: name_inputs(t, e, end_us);
    }
    for (int k = 0; cause == WRCD_CAUSE_UNCHANGED && k < 2 && k < e->listed; k++) {
        e->number[2 * k] = t->input_state[e->input[k]].seen;
        e->number[2 * k + 1] = (double)t->input_state[e->input[k]].run;
    }
}

/* An axle was started anew: the speed jumped. */
void wrcd_tell_jump(const wrcd_train *t, wrcd_out *out, int axle, int64_t end_us)
{
    wrcd_event *e = new_event(out, WRCD_DETAIL_EVENT, axle, WRCD_CAUSE_RESTARTED, end_us);

    e->listed = 1;
    e->number[0] = fabs(wrcd_value_of(t, WRCD_SPEED, 0));
}

/* The same: measurements stayed outliers, or one stood out among the first. By how often its usual size each channel's
 * innovation is off, of the model that it fits best; by how much the yaw rate differs from the newest that was used; and
 * for how long the axle waits. */
void wrcd_tell_outliers(const wrcd_train *t, wrcd_out *out, int axle, double yaw_rate, double wait_s, int64_t end_us)
{
    wrcd_event *e = new_event(out, WRCD_DETAIL_EVENT, axle, WRCD_CAUSE_RESTARTED, end_us);

    double innovations[WRCD_MODELS][WRCD_CHANNELS];

    for (int k = 0; k < WRCD_MODELS; k++)
        for (int c = 0; c < WRCD_CHANNELS; c++)
            innovations[k][c] = t->result->innovations[k][c][axle];
    wrcd_gate_why(t->estimator, axle, (const double (*)[WRCD_CHANNELS])innovations, yaw_rate, e->number);
    e->number[2 * WRCD_CHANNELS + 1] = wait_s;
}

static bool is_of_pair(int cause) { return cause >= WRCD_CAUSE_SENSORS_SILENT && cause <= WRCD_CAUSE_GYRO_DEAD; }

static void put_figures(const wrcd_train *t, wrcd_event *e, int64_t end_us)
{
    const wrcd_axle_state *a = &t->axle[e->axle];

    e->figures = WRCD_OWN_FIGURES;
    if (is_of_pair(e->cause)) {
        double p[WRCD_PAIR_STATES];
        wrcd_health_figures(t->estimator, e->axle, p, e->number);
        e->number[5] = p[(int)e->number[0]];
        e->number[6] = p[0];
    } else if (e->cause == WRCD_CAUSE_STANDSTILL)
        e->number[0] = wrcd_value_of(t, WRCD_SPEED, 0);
    else if (e->cause == WRCD_CAUSE_WARMING_UP)
        e->number[0] = (double)a->fresh_ticks;
    else if (e->cause == WRCD_CAUSE_INPUT_SILENT)
        name_inputs(t, e, end_us);
    else
        e->figures = WRCD_KNOWN_FIGURES;
}

/* What an estimate says against itself. */
static void put_estimate(wrcd_event *e, const wrcd_adhesion *a)
{
    e->figures = WRCD_ESTIMATE_FIGURES;
    if (e->cause == WRCD_CAUSE_BEYOND_TRAINING) {
        memcpy(e->number, a->inputs, WRCD_MODELS * sizeof *e->number);
        return;
    }
    e->number[0] = a->live_share;
    e->number[1] = a->window_s;
    e->number[2] = a->doubt;
    e->number[3] = a->mu_available_pct;
    e->number[4] = a->firing;
    e->number[5] = a->used_pct;
    e->number[6] = a->mu_from_rules_pct;
}

/* A slot's reports [axle] differ from those before; has_changed: whose standing does. */
void wrcd_tell_changes(const wrcd_train *t, wrcd_out *out, const wrcd_report *report, const bool *has_changed)
{
    for (int axle = 0; axle < t->settings->axles; axle++) {
        const wrcd_report *r = &report[axle];
        wrcd_axle_state *a = &t->axle[axle];
        a->confidence = r->confidence;
        if (r->cause == a->cause && r->validity == a->validity)
            continue;
        wrcd_event *e = new_event(out, WRCD_CHANGE_EVENT, axle, r->cause, r->time_us);
        e->before = a->validity;
        e->after = r->validity;
        if (a->standing != WRCD_CAUSE_NONE && has_changed[axle])
            put_figures(t, e, r->time_us);
        else if (r->validity == WRCD_DEGRADED)
            put_estimate(e, &r->estimate);
        e->is_over = a->standing == WRCD_CAUSE_NONE;
        a->cause = r->cause;
        a->validity = r->validity;
    }
}
