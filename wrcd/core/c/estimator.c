/* One tick after the other: signals, bank, residuals, rules, memory, health. */
#include "parts.h"

enum { OFFSET_WINDOWS = 2 }; /* memory of the sensors' offsets, in windows */

size_t wrcd_size(const wrcd_design *d, int axles)
{
    bool fits = axles >= 1 && axles <= WRCD_MAX_AXLES && d->states <= WRCD_MAX_STATES && d->rules <= WRCD_MAX_RULES
        && d->powers <= WRCD_MAX_POLYNOMIAL && d->lowpass_sections <= WRCD_MAX_SECTIONS
        && d->highpass_sections <= WRCD_MAX_SECTIONS
        && (d->health == NULL || d->health->hidden_units <= WRCD_MAX_HIDDEN);

    for (int i = 0; i < WRCD_INPUTS; i++)
        fits = fits && d->sets[i] <= WRCD_MAX_SETS;
    return fits ? WRCD_STATE_BYTES(axles, d->longest, d->longest_wheelbase_ticks) : 0;
}

void wrcd_begin(wrcd_estimator *e, const wrcd_design *d, int axles)
{
    memset(e, 0, WRCD_STATE_BYTES(axles, d->longest, d->longest_wheelbase_ticks));
    e->axles = axles;
    e->speed = NAN;
    e->speed_m_s = d->speed_low_m_s;
    e->window_newest = e->node = -1.0;
    for (int axle = 0; axle < axles; axle++)
        e->partner[axle] = (axle ^ 1) < axles ? axle ^ 1 : -1;
    for (int axle = 0; axle < axles; axle++) {
        double *odds = e->axle[axle].log_odds;
        wrcd_reset(e, d, axle);
        for (int k = 0; k < WRCD_PAIR_STATES; k++)
            odds[k] = d->health != NULL ? d->health->log_prior[k] : k == 0 ? 0.0 : -CERTAIN;
    }
}

/* What is known of the wires (log_odds, health_rows), and the noise's newest samples, stay. */
void wrcd_reset(wrcd_estimator *e, const wrcd_design *d, int axle)
{
    wrcd_axle *a = &e->axle[axle];
    bool any = false;

    wrcd_signals_reset(a, d);
#define CLEAR(field) memset(&a->field, 0, sizeof a->field)
    CLEAR(bank_x), CLEAR(complete), CLEAR(started), CLEAR(delayed), CLEAR(delayed_live), CLEAR(delayed_clear), CLEAR(memory);
    CLEAR(slide);
#undef CLEAR
    wrcd_window_reset(e, d, axle);
    wrcd_bands_reset(e, d, axle);
    for (int other = 0; other < (int)e->axles; other++)
        any = any || e->axle[other].started > 0.0;
    if (!any) { /* the speed is all axles' */
        e->speed = NAN;
        e->speed_rate = e->speed_ticks = 0.0;
    }
}

/* The bank with a measurement, or without; near a pulse it teaches no offset. */
static void filtered(wrcd_axle *a, const wrcd_design *d, const bank_matrices *at, const double z[CHANNELS], bool present,
                     bool near, double e[MODELS][CHANNELS], double w[MODELS][CHANNELS])
{
    double deviation[CHANNELS];

    wrcd_offset_step(a, OFFSET_WINDOWS * d->window_ticks, z, present && !near, deviation);
    wrcd_bank_step(at, d->states, a->bank_x, deviation, present, e, w);
}

/* Innovations enter the window WRCD_HOLD ticks late, when it is known whether a pulse follows; those about one and those
 * that must stay out enter as zeros. */
static void put(wrcd_estimator *e, const wrcd_design *d, int axle, const wrcd_tick *tick, double w[MODELS][CHANNELS],
                bool in_window, bool pulse, bool near, wrcd_result *result)
{
    wrcd_axle *a = &e->axle[axle];
    double raw[W], smooth[W];

    for (int k = 0; pulse && k < WRCD_HOLD; k++)
        a->delayed_clear[k] = 0.0;
    const bool heard = a->delayed_live[0] > 0.0, live = heard && a->delayed_clear[0] > 0.0;
    memset(raw, 0, sizeof raw);
    if (live)
        memcpy(raw, a->delayed[0], sizeof raw);
    memmove(a->delayed[0], a->delayed[1], (WRCD_HOLD - 1) * sizeof a->delayed[0]);
    memmove(a->delayed_live, a->delayed_live + 1, (WRCD_HOLD - 1) * sizeof(double));
    memmove(a->delayed_clear, a->delayed_clear + 1, (WRCD_HOLD - 1) * sizeof(double));
    memcpy(a->delayed[WRCD_HOLD - 1], w, sizeof a->delayed[0]);
    a->delayed_live[WRCD_HOLD - 1] = in_window ? 1.0 : 0.0;
    a->delayed_clear[WRCD_HOLD - 1] = near ? 0.0 : 1.0;
    memcpy(smooth, raw, sizeof smooth);
    if (!d->is_paper)
        wrcd_sections_step(d->lowpass, d->lowpass_sections, a->lowpass[0], W, smooth);
    const bool calm = live && !wrcd_joints_recovering(a);
    const window_tick is = {a->started > 0.0, heard, live, calm, tick->torque_ratio[axle]};
    wrcd_window_put(e, d, axle, tick->number, smooth, raw, is);
    result->live[axle] = live;
    result->calm[axle] = calm;
}

/* One tick of an axle, whatever it brings. Without both measurements, or with an outlier in either, it is predicted over.
 * One channel alone is not enough: with its part of a gain made for two, a filter would be unstable. */
static int step_axle(wrcd_estimator *e, const wrcd_design *d, const bank_matrices *at, int axle, const wrcd_tick *tick,
                     wrcd_result *result)
{
    const int axles = (int)e->axles;
    wrcd_axle *a = &e->axle[axle];
    const double z[CHANNELS] = {tick->z[axle], tick->z[axles + axle]};
    const bool whole = tick->present[axle] && tick->present[axles + axle];
    const double offset[2 * CHANNELS] = {a->offset_mean[0], a->offset_mean[1], a->offset_count[0], a->offset_count[1]};
    double innovation[MODELS][CHANNELS], w[MODELS][CHANNELS], x[MODELS][WRCD_MAX_STATES];
    bool small[CHANNELS], outlier[CHANNELS], near;
    int found = 0;

    for (int c = 0; c < CHANNELS; c++)
        small[c] = fabs(z[c] - a->offset_mean[c]) <= WRCD_MAX_PULSE[c];
    memcpy(x, a->bank_x, sizeof x);
    /* by the acceleration alone: held while a wheelset hunts, it would have steps, and those are pulses */
    const bool pulse = wrcd_joints_step(a, d, z[LAT], whole && small[LAT], &near);
    filtered(a, d, at, z, whole, near, innovation, w);
    const bool swings = wrcd_joints_recovering(a) && small[YAW] && small[LAT];
    wrcd_gate_outliers(a, (const double (*)[CHANNELS])innovation, z[YAW], whole && !swings, outlier);
    const bool left_out = outlier[YAW] || outlier[LAT], accepted = whole && !left_out;
    for (int k = 0; k < MODELS; k++)
        for (int c = 0; c < CHANNELS; c++)
            result->innovations[k][c][axle] = innovation[k][c];
    if (left_out) {
        e->outliers += (outlier[YAW] ? 1.0 : 0.0) + (outlier[LAT] ? 1.0 : 0.0);
        memcpy(a->bank_x, x, sizeof x);
        memcpy(a->offset_mean, offset, sizeof a->offset_mean);
        memcpy(a->offset_count, offset + CHANNELS, sizeof a->offset_count);
        filtered(a, d, at, z, accepted, near, innovation, w);
        found |= WRCD_OUTLIERS;
    }
    bool reset = wrcd_gate_learn(a, (const double (*)[CHANNELS])innovation, z[YAW], accepted && !swings, outlier);
    for (int k = 0; k < MODELS; k++)
        for (int i = 0; i < d->states; i++)
            reset = reset || !isfinite(a->bank_x[k][i]);
    wrcd_noise_step(a, d, z, accepted && !near);
    if (!d->is_paper)
        wrcd_bands_step(e, d, axle, z, accepted && !near);
    a->started = accepted ? 1.0 : a->started;
    /* The first innovation after a gap spans several ticks, and stays out. A sensor slower than the ticks, for which no gain
     * here is made, therefore never gives an estimate. */
    const bool in_window = accepted && a->complete > 0.0 && isfinite(tick->torque_ratio[axle]) && !reset;
    a->complete = accepted ? 1.0 : 0.0;
    put(e, d, axle, tick, w, in_window, pulse, near, result);
    for (int k = 0; k < MODELS; k++)
        for (int c = 0; c < CHANNELS; c++)
            result->whitened[k][c][axle] = w[k][c];
    result->accepted[axle] = accepted;
    result->outliers[axle] = left_out;
    result->near_pulse[axle] = near;
    result->needs_reset[axle] = reset;
    return found | (reset ? WRCD_NEEDS_RESET : 0);
}

/* What an axle's window shows at the tick's end: whether rail or torque have changed, and sometimes the rules' word on it. */
static void look_back(wrcd_estimator *e, const wrcd_design *d, int64_t ticks)
{
    const int axles = (int)e->axles;
    double inputs[WRCD_MAX_AXLES][WRCD_COLUMNS], ratio[WRCD_MAX_AXLES] = {0.0};

    for (int axle = 0; ticks % WRCD_BLOCK_TICKS == 0 && axle < axles; axle++)
        wrcd_memory_changes(e, d, axle);
    if (ticks % REMEMBER_TICKS != 0)
        return;
    for (int axle = 0; axle < axles; axle++)
        wrcd_memory_remember(e, d, axle, inputs[axle], &ratio[axle]);
    wrcd_slides_end(e, (double)REMEMBER_TICKS * d->tick_s);
    if (d->health != NULL && ticks % SPAN_TICKS == 0)
        wrcd_health_look(e, d, (const double (*)[WRCD_COLUMNS])inputs, ratio);
}

int wrcd_step(wrcd_estimator *e, const wrcd_design *d, const wrcd_tick *tick, wrcd_result *result)
{
    bank_matrices at;
    int found = 0;

    e->speed_m_s = wrcd_speed_step(e, d, tick->speed_m_s);
    wrcd_bank_at(e, d, e->speed_m_s, &at);
    wrcd_window_move(e, d, tick->number / WRCD_BLOCK_TICKS);
    for (int axle = 0; axle < (int)e->axles; axle++)
        found |= step_axle(e, d, &at, axle, tick, result);
    if (!d->is_paper) {
        wrcd_bands_end_of_tick(e, d);
        look_back(e, d, tick->number + 1);
    }
    return found;
}
