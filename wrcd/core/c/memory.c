/* What the rail was a moment ago: the window is cut where rail or torque change, the rules' words so far are fused, and what
 * was in use at the last peak is carried on.
 *
 * While nothing changes, the rules' word on the newest second is fused with those before: a mean of log adhesion in which each
 * word weighs by its spread, forgotten within seconds. Where the window's own word lies far from the fused one, or above it for
 * long, or its newest part speaks of another rail, the memory begins anew. What is in use is available: that bound is carried
 * across cuts of the window and changes of torque, and erodes with time and way. Where the wheelset is saturated on less, the
 * rail has become worse, and the bound is what is in use. */
#include "parts.h"

/* A torque of the moment that differs by this share and this ratio from what it was is a change, of the drive or of the rail.
 * The first is against the moment before, the second against all of the rest: a driver's slow turning of the torque leaves the
 * window longer than a slide does. */
static const double TORQUE_STEP = 0.15, TORQUE_STEP_RATIO = 0.004, TORQUE_TURN = 0.15, TORQUE_TURN_RATIO = 0.01;

static bool turned(double now, double before, double share, double ratio)
{
    return fabs(now - before) > share * greater(now, before) + ratio;
}

/* Where the rail or the torque has changed within the window, what came before is dropped. */
void wrcd_memory_changes(wrcd_estimator *e, const wrcd_design *d, int axle)
{
    double newer[SUMS], rest[SUMS], before[SUMS], apart[MODELS], limits[MODELS];
    bool changed = false;

    wrcd_window_sums(e, d, axle, 0, d->recent, false, newer);
    wrcd_window_sums(e, d, axle, d->recent, d->usual, false, rest);
    wrcd_window_decades(newer, rest, d->min_ticks, apart);
    wrcd_table_at(&d->changes, e->speed_m_s, limits);
    for (int k = 0; k < MODELS; k++)
        changed = changed || fabs(apart[k]) > limits[k];
    if (isfinite(apart[0])) {
        const double now = wrcd_window_torque_now(e, d, axle);
        wrcd_window_sums(e, d, axle, d->now, d->now + d->step, false, before);
        changed = changed || turned(now, torque_of(before), TORQUE_STEP, TORQUE_STEP_RATIO)
            || turned(now, torque_of(rest), TORQUE_TURN, TORQUE_TURN_RATIO);
    }
    if (changed)
        wrcd_window_truncate(e, axle, d->recent);
}

static const double KEPT = 0.94; /* of the words so far, at each: a memory of 1.3 s */
/* A word counts as so many independent ones: of 80 ms in a window of 1 s, and what is wrong in one is wrong in the next. */
static const double WEIGHT = 0.08 * 0.6;
/* The window's own word takes over where it is off by so many of its standard deviations, below or above; it begins to count at
 * half of that. What is worse is believed sooner. */
static const double BELOW = 2.5, ABOVE = 3.0;
/* Where the window was cut, its word takes over at this share of them, and where its deviation is so large. */
static const double CUT = 0.5, VAGUE = 0.3;
/* The rail has become better where the sum of what words lie beyond so many deviations above reaches so many seconds; a memory
 * begins with so much of the word then. */
static const double BEYOND = 0.8, REACHED_S = 0.6, BEGINS_BETTER = 0.5;
/* The bound erodes after HOLD_S, within so many seconds and metres; saturated: this share of the newest part's word. */
static const double HOLD_S = 0.5, ERODES_S = 6.0, ERODES_M = 120.0, SATURATED = 0.87;
static const double AGAIN = 0.98; /* of what was in use at the peak: as much again */
/* It is another rail where the newest part's word lies so many standard deviations, of both, below or above for so many
 * steps. */
static const double WORSE = 2.0, BETTER = 2.5;
enum { ANOTHER_STEPS = 2 };
static const double NEWEST = 1.8; /* times as far as their spread says do the newest part's words scatter on a steady rail */
static const double CLEAR = 0.8;  /* of the newest part that must hold data: lost measurements and pulses are no other rail */
static const double BEGINS = 0.2; /* of a word's weight is what a memory begins with: the rail may still be changing */
static const double LEAST_PCT = 0.01; /* a word of less is this: there is no logarithm of nothing */

rail_word wrcd_memory_word(const window_answer *a) { return (rail_word){log(greater(a->mu_pct, LEAST_PCT)), a->spread / SIGMAS}; }

/* The fused word where there is one, on its way to the window's own (share 1) where that lies far from it. */
rail_word wrcd_memory_spoken(double precision, double weighed, rail_word own, bool whole, double *share)
{
    const bool none = precision == 0.0 || !isfinite(own.sigma);
    const double x = weighed / precision, apart = (own.log_pct - x) / own.sigma;
    double far = apart < 0.0 ? -apart / BELOW : apart / ABOVE;

    if (!whole)
        far = greater(far / CUT, own.sigma / VAGUE);
    *share = none ? 1.0 : held(2.0 * far - 1.0, 0.0, 1.0);
    if (!(*share < 1.0))
        return own;
    const double sigma = lesser(1.0 / sqrt(precision), own.sigma);
    return (rail_word){(1.0 - *share) * x + *share * own.log_pct, (1.0 - *share) * sigma + *share * own.sigma};
}

/* A step later: the word of the window, which is whole or cut, and that of its newest part, of which a share holds data;
 * in_use_pct: what has been in use all the time lately. Returns whether it is another rail. */
bool wrcd_memory_fuse(double m[WRCD_REMEMBERED], rail_word own, bool whole, rail_word newest, double live_share,
                      double in_use_pct, double step_s, double speed_m_s)
{
    const bool usable = isfinite(own.sigma);
    const double new_precision = 1.0 / (own.sigma * own.sigma);
    double precision = KEPT * m[PRECISION] + WEIGHT * new_precision, share;
    double weighed = KEPT * m[WEIGHED] + WEIGHT * new_precision * own.log_pct;

    (void)wrcd_memory_spoken(precision, weighed, own, whole, &share);
    const double above = whole ? (own.log_pct - m[WEIGHED] / m[PRECISION]) / own.sigma - BEYOND : -BEYOND;
    const double above_s = m[PRECISION] > 0.0 && usable ? greater(m[ABOVE_S] + above * step_s, 0.0) : 0.0;
    const bool better = above_s > REACHED_S, begins = better || m[PRECISION] == 0.0 || share >= 1.0;
    const double begins_with = (better ? BEGINS_BETTER : BEGINS) * new_precision;
    precision = !usable ? 0.0 : begins ? begins_with : precision;
    weighed = !usable ? 0.0 : begins ? begins_with * own.log_pct : weighed;
    const double in_use = isfinite(in_use_pct) ? in_use_pct : 0.0;
    const bool at_peak = in_use >= AGAIN * m[PEAK_PCT] || in_use >= SATURATED * exp(newest.log_pct);
    const double since_s = at_peak ? 0.0 : m[PEAK_AGE_S] + step_s;
    const double erodes = since_s > HOLD_S ? exp(-step_s * (1.0 / ERODES_S + speed_m_s / ERODES_M)) : 1.0;
    const double scatter = NEWEST * newest.sigma;
    const double apart = (newest.log_pct - weighed / precision) / sqrt(scatter * scatter + 1.0 / precision);
    const bool off = whole && usable && live_share >= CLEAR && (apart < -WORSE || apart > BETTER);
    m[ANOTHER] = off ? m[ANOTHER] + 1.0 : 0.0;
    const bool anew = m[ANOTHER] >= (double)ANOTHER_STEPS;
    m[PRECISION] = anew ? 0.0 : precision;
    m[WEIGHED] = anew ? 0.0 : weighed;
    m[ABOVE_S] = anew || begins ? 0.0 : above_s;
    m[PEAK_PCT] = at_peak ? in_use : m[PEAK_PCT] * erodes;
    m[PEAK_AGE_S] = since_s;
    m[SINCE_M] = anew || begins || !usable ? 0.0 : m[SINCE_M] + step_s * speed_m_s;
    return anew;
}

/* The rules' word of this moment is fused with those before. Gives what the usual window gave the rules, and the torque. */
void wrcd_memory_remember(wrcd_estimator *e, const wrcd_design *d, int axle, double inputs[WRCD_COLUMNS], double *ratio)
{
    window_answer usual, recent;
    rules_moment at;
    wrcd_adhesion now;

    wrcd_rules_ask_both(e, d, axle, &at, &usual, &recent);
    wrcd_estimate_of(e, d, axle, &at, &usual, &recent, &now);
    wrcd_slides_look(e, axle, &now, at.lasted, (double)REMEMBER_TICKS * d->tick_s);
    memcpy(inputs, usual.inputs, sizeof usual.inputs);
    *ratio = at.now;
    const bool whole = usual.blocks * WRCD_BLOCK_TICKS >= d->window_ticks;
    if (wrcd_memory_fuse(e->axle[axle].memory, wrcd_memory_word(&usual), whole, wrcd_memory_word(&recent), recent.s.live_share,
                         100.0 * at.lasting, (double)REMEMBER_TICKS * d->tick_s, e->speed_m_s))
        wrcd_window_truncate(e, axle, d->recent);
}
