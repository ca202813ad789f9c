/* Whether an axle is Valid, and if not, why: decided here and nowhere else.
 *
 * A tick is sound if nothing speaks against what it brought. An estimate is as old as its window: it is Valid only after a
 * full window of sound ticks, from a pair of sensors that nothing speaks against, and if it does not doubt itself. An
 * interval that is wide is no doubt: Confidence says it.
 * A short silence of an input is not unsound: it brings nothing, and the bank predicts over it. While it lasts the axle is
 * Degraded; the window goes on after it. */
#include "core.h"

/* Of a pair of sensors, by wrcd_pair_state(); of an estimate, by enum wrcd_doubt. */
static const int OF_PAIR[WRCD_PAIR_STATES] = {
    WRCD_CAUSE_NONE, WRCD_CAUSE_GYRO_REVERSED, WRCD_CAUSE_GYRO_DEAD, WRCD_CAUSE_ACCEL_SMALL, WRCD_CAUSE_SENSORS_SILENT,
    WRCD_CAUSE_SENSORS_UNRELATED, WRCD_CAUSE_ACCEL_SMALL, WRCD_CAUSE_SENSORS_UNRELATED,
};
static const int OF_DOUBT[WRCD_GAPS + 1] = {
    WRCD_CAUSE_NONE, WRCD_CAUSE_NO_RULE, WRCD_CAUSE_BEYOND_TRAINING, WRCD_CAUSE_HARSH, WRCD_CAUSE_TOO_LITTLE_DATA,
    WRCD_CAUSE_TOO_LITTLE_DATA,
};

static bool lies_in(double share, const double range[2]) { return range[0] <= share && share <= range[1]; }

/* What speaks against the slow inputs' values. */
static int doubtful(const wrcd_train *t, int axle)
{
    const wrcd_settings *s = t->settings;

    if (wrcd_torques_contradict(t, axle))
        return WRCD_CAUSE_TORQUES_CONTRADICT;
    if (wrcd_friction_share_unknown(t, axle))
        return WRCD_CAUSE_FRICTION_SHARE_UNKNOWN;
    if (!lies_in(wrcd_total_of(t, WRCD_LOAD, axle) / s->load_N, s->load_shares))
        return WRCD_CAUSE_LOAD_BEYOND;
    return lies_in(wrcd_value_of(t, WRCD_RADIUS, axle) / s->radius_m, s->radius_shares) ? WRCD_CAUSE_NONE
                                                                                       : WRCD_CAUSE_RADIUS_BEYOND;
}

/* What speaks against the tick that was closed, of each axle: the first of all that does. */
void wrcd_tick_causes(const wrcd_train *t, const tick_inputs *tick, int64_t end_us, int32_t cause[WRCD_MAX_AXLES])
{
    const double speed = fabs(tick->speed_m_s);
    const bool is_covered = t->settings->speed_low_m_s <= speed && speed <= t->settings->speed_high_m_s;
    int32_t contested = 0, degraded = 0, unchanged = 0;

    for (int k = 0; k < t->settings->inputs; k++) {
        contested |= t->input_state[k].is_contested ? t->input[k].axles : 0;
        degraded |= t->input_state[k].is_degraded ? t->input[k].axles : 0;
        unchanged |= wrcd_is_unchanged(t, k, end_us) ? t->input[k].axles : 0;
    }
    for (int axle = 0; axle < t->settings->axles; axle++)
        cause[axle] = has(tick->stale, axle) ? WRCD_CAUSE_INPUT_STALE
            : has(contested, axle) ? WRCD_CAUSE_TWO_SENDERS
            : has(degraded, axle) ? WRCD_CAUSE_SENSOR_DEGRADED
            : has(unchanged, axle) ? WRCD_CAUSE_UNCHANGED
            : !is_covered ? WRCD_CAUSE_SPEED_OUT_OF_RANGE
            : doubtful(t, axle);
}

/* What was known before does not hold any more, or nothing is known. */
void wrcd_validity_reset(wrcd_axle_state *a, int why)
{
    a->stale_ticks = a->fresh_ticks = a->sound_ticks = 0;
    a->window_full = a->newest = a->unsound = 0;
    a->begun = why;
}

/* A tick with all that an estimate needs, and what speaks against it. */
void wrcd_validity_update(wrcd_axle_state *a, int window_ticks, int cause)
{
    a->stale_ticks = cause == WRCD_CAUSE_INPUT_STALE ? a->stale_ticks + 1 : 0;
    const bool is_bridged = a->stale_ticks > 0 && a->stale_ticks <= BRIDGED_TICKS;

    if (cause == WRCD_CAUSE_NONE) {
        a->fresh_ticks++;
        a->sound_ticks++;
    } else if (!is_bridged) {
        a->fresh_ticks = a->stale_ticks > 0 ? 0 : a->fresh_ticks + 1;
        a->sound_ticks = 0;
        a->unsound = cause;
    }
    if ((cause == WRCD_CAUSE_NONE || is_bridged) && (a->begun == WRCD_CAUSE_STANDSTILL || a->begun == WRCD_CAUSE_INPUT_SILENT))
        a->begun = WRCD_CAUSE_WARMING_UP; /* that is over */
    a->window_full = a->window_full || a->fresh_ticks >= window_ticks;
    a->newest = cause;
}

/* Of an axle now, with the state of its pair of sensors: all that there is to say without its estimate. */
void wrcd_standing(const wrcd_axle_state *a, int window_ticks, int pair, int *has_estimate, int *cause)
{
    *has_estimate = a->window_full;
    *cause = a->newest != WRCD_CAUSE_NONE ? a->newest
        : !a->window_full ? a->begun
        : a->sound_ticks < window_ticks ? a->unsound
        : OF_PAIR[pair];
}

/* Valid or not, and why not, of an axle with this standing cause. a: its estimate, NULL without one. */
int wrcd_verdict(int standing, const wrcd_adhesion *a, int *cause)
{
    *cause = standing;
    if (a == NULL)
        return WRCD_NOT_AVAILABLE;
    if (standing == WRCD_CAUSE_NONE)
        *cause = (int)a->doubt != WRCD_NO_DOUBT ? OF_DOUBT[(int)a->doubt]
            : !isfinite(a->mu_available_pct) ? WRCD_CAUSE_TOO_LITTLE_DATA
            : a->contradicted > 0.0 ? WRCD_CAUSE_CONTRADICTION : WRCD_CAUSE_NONE;
    return *cause == WRCD_CAUSE_NONE ? WRCD_VALID : WRCD_DEGRADED;
}

/* An axle was reset in a tick; no full window of good ticks came since the resets before it. */
void wrcd_backoff_was_reset(const wrcd_train *t, wrcd_axle_state *a, int64_t tick)
{
    const double tick_s = t->design->tick_s;

    const int64_t doublings = a->resets_in_a_row++ - FREE_RESETS;
    if (doublings < 0)
        return;
    t->core->waits++;
    a->waits_until = tick + 1 + (int64_t)nearbyint(fmin(ldexp(FIRST_WAIT_S, (int)doublings), LAST_WAIT_S) / tick_s);
}

/* For how long the axle is left alone from a tick on. */
double wrcd_backoff_wait_s(const wrcd_train *t, const wrcd_axle_state *a, int64_t tick)
{
    const int64_t ticks = a->waits_until - tick - 1;

    return ticks > 0 ? (double)ticks * t->design->tick_s : 0.0;
}
