/* From a window to the adhesion: residual RMS, rules, memory, interval, and what speaks against it.
 * As answer.py, paper/rule_inputs.py, trust/changes.py, trust/memory.py and trust/interval.py. */
#include "parts.h"

enum { LAG = WRCD_INPUTS, CROSS = LAG + W, LENGTH = CROSS + MODELS, NOISE, SWING = NOISE + CHANNELS, STEP = SWING + 2 };
enum { PRECISION, WEIGHED, PEAK_PCT, PEAK_AGE_S, ANOTHER }; /* what is remembered */

typedef struct { /* of one axle, at one moment */
    double now, lasting, range[2], step[MODELS], noise_factor[CHANNELS], floor[MODELS], grid_speed_m_s;
} moment;

typedef struct { /* what the rules say of one window: adhesion, and its half-width as a share of it */
    double mu_pct, spread, inputs[WRCD_COLUMNS];
    int blocks;
    window_statistics s;
    rules_answer rules;
} answer;

typedef struct { double log_pct, sigma; } word;

static double torque_of(const double sums[SUMS]) { return sums[RATIO] / sums[RATIO_N]; }

double wrcd_answer_torque_now(const wrcd_estimator *e, const wrcd_design *d, int axle)
{
    double sums[SUMS];

    wrcd_window_sums(e, d, axle, 0, d->now, false, sums);
    return torque_of(sums);
}

static void take(const wrcd_estimator *e, const wrcd_design *d, int axle, double now, moment *m)
{
    double newer[SUMS], before[SUMS], power[MODELS * CHANNELS];
    const int half = d->usual / 2;

    m->now = now;
    wrcd_window_sums(e, d, axle, d->now, d->now + d->step, true, before);
    m->lasting = fmin(now, torque_of(before));
    wrcd_window_torque_range(e, d, axle, half, m->range);
    wrcd_window_sums(e, d, axle, 0, d->recent, true, newer);
    wrcd_window_sums(e, d, axle, d->recent, d->recent + half, true, before);
    wrcd_window_decades(newer, before, d->min_ticks, m->step);
    wrcd_noise_sensor_factor(&e->axle[axle], m->noise_factor);
    m->grid_speed_m_s = held(e->speed_m_s, d->speed_low_m_s, d->speed_high_m_s);
    wrcd_table_at(&d->noise_power, m->grid_speed_m_s, power);
    for (int k = 0; k < MODELS; k++) {
        m->floor[k] = 0.0;
        for (int c = 0; c < CHANNELS; c++)
            m->floor[k] += power[CHANNELS * k + c] * (m->noise_factor[c] * m->noise_factor[c]);
        m->floor[k] /= CHANNELS;
    }
}

static const double MIN_TORQUE = 0.003, TORQUE_FLOOR = 0.01, MIN_TRACK = 0.03, MAX_STEP = 1.5;

/* What the rules are given: log10 of residuals 1 to 3 over residual 4 and of residual 4, of torque ratio and speed; the
 * correlations; log10 of the window's length and of the noise; the torque's swing; the steps. */
static void columns_of(const wrcd_design *d, const moment *m, const window_statistics *s, double ratio, double x[WRCD_COLUMNS])
{
    double logs[MODELS], torque[3] = {m->range[0], m->now, m->range[1]}, largest = 0.0;

    for (int k = 0; k < MODELS; k++)
        logs[k] = d->is_paper ? log10(sqrt(s->mean_square[k]))
            : 0.5 * log10(greater(s->mean_square[k] - m->floor[k], MIN_TRACK * m->floor[k]));
    for (int k = 0; k < MODELS; k++)
        x[k] = d->is_paper || k == MODELS - 1 ? logs[k] : logs[k] - logs[MODELS - 1];
    x[MODELS] = log10(greater(ratio, MIN_TORQUE));
    x[MODELS + 1] = log10(m->grid_speed_m_s);
    memcpy(x + LAG, s->lag, sizeof s->lag);
    memcpy(x + CROSS, s->cross, sizeof s->cross);
    x[LENGTH] = log10(s->ticks * d->tick_s);
    for (int c = 0; c < CHANNELS; c++)
        x[NOISE + c] = log10(m->noise_factor[c]);
    for (int k = 0; k < 3; k++)
        torque[k] = log10(greater(torque[k], 0.0) + TORQUE_FLOOR);
    x[SWING] = torque[2] - torque[1];
    x[SWING + 1] = torque[1] - torque[0];
    double step[MODELS];
    for (int k = 0; k < MODELS; k++) {
        step[k] = isnan(m->step[k]) ? 0.0 : held(m->step[k], -MAX_STEP, MAX_STEP);
        largest = greater(largest, fabs(step[k]));
    }
    x[STEP] = 0.5 * (step[0] + step[1]);
    x[STEP + 1] = step[2];
    x[STEP + 2] = step[3];
    x[STEP + 3] = largest;
}

/* What the rules say of the newest blocks. In a window shorter than the usual one the torque has changed: that of the moment
 * counts. (16) makes percent of their output. */
static void ask(const wrcd_estimator *e, const wrcd_design *d, int axle, const moment *m, int blocks, answer *out)
{
    double sums[SUMS];

    wrcd_window_sums(e, d, axle, 0, blocks, false, sums);
    wrcd_window_statistics_of(sums, d->min_ticks, &out->s);
    columns_of(d, m, &out->s, !d->is_paper && blocks < d->usual ? m->now : out->s.ratio, out->inputs);
    wrcd_rules_infer(d, out->inputs, &out->rules);
    double mu = 0.0 * out->rules.output;
    for (int k = 0; k < d->powers; k++)
        mu = mu * out->rules.output + d->polynomial[k];
    out->mu_pct = held(mu, d->adhesion_low_pct, d->adhesion_high_pct);
    out->spread = out->rules.spread;
    out->blocks = blocks;
}

void wrcd_answer_inputs_of(const wrcd_estimator *e, const wrcd_design *d, int axle, int blocks, double now, double inputs[WRCD_COLUMNS])
{
    answer out;
    moment m;

    take(e, d, axle, now, &m);
    ask(e, d, axle, &m, blocks, &out);
    memcpy(inputs, out.inputs, sizeof out.inputs);
}

/* The rules' answers of the usual window and of its newest part. */
static void ask_both(const wrcd_estimator *e, const wrcd_design *d, int axle, moment *m, answer *usual, answer *recent)
{
    const int filled = wrcd_window_filled(e, d, axle);

    take(e, d, axle, wrcd_answer_torque_now(e, d, axle), m);
    ask(e, d, axle, m, filled < d->usual ? filled : d->usual, usual);
    if (!d->is_paper)
        ask(e, d, axle, m, filled < d->recent ? filled : d->recent, recent);
}

static const double TORQUE_STEP = 0.15, TORQUE_STEP_RATIO = 0.004, TORQUE_TURN = 0.15, TORQUE_TURN_RATIO = 0.01;

static bool turned(double now, double before, double share, double ratio)
{
    return fabs(now - before) > share * greater(now, before) + ratio;
}

/* Where the rail or the torque has changed within the window, what came before is dropped. */
void wrcd_answer_changes(wrcd_estimator *e, const wrcd_design *d, int axle)
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
        const double now = wrcd_answer_torque_now(e, d, axle);
        wrcd_window_sums(e, d, axle, d->now, d->now + d->step, false, before);
        changed = changed || turned(now, torque_of(before), TORQUE_STEP, TORQUE_STEP_RATIO)
            || turned(now, torque_of(rest), TORQUE_TURN, TORQUE_TURN_RATIO);
    }
    if (changed)
        wrcd_window_truncate(e, axle, d->recent);
}

static const double KEPT = 0.94, WEIGHT = 0.08 * 0.6, BELOW = 2.5, ABOVE = 3.0, SIGMAS = 1.645;
static const double HOLD_S = 0.5, ERODES_S = 6.0, ERODES_M = 120.0, SATURATED = 0.87, WORSE = 2.0, BETTER = 2.5;
static const double NEWEST = 1.8, CUT = 0.5, VAGUE = 0.3, BEGINS = 0.2, CLEAR = 0.8, AGAIN = 0.98, LEAST_PCT = 0.01;
enum { STEP_TICKS = 16, ANOTHER_STEPS = 2 };

static word word_of(const answer *a) { return (word){log(greater(a->mu_pct, LEAST_PCT)), a->spread / SIGMAS}; }

/* The fused word where there is one, on its way to the window's own (share 1) where that lies far from it. */
static word spoken(double precision, double weighed, word own, bool whole, double *share)
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
    return (word){(1.0 - *share) * x + *share * own.log_pct, (1.0 - *share) * sigma + *share * own.sigma};
}

/* The rules' word of this moment is fused with those before. Gives what the usual window gave the rules, and the torque. */
void wrcd_answer_remember(wrcd_estimator *e, const wrcd_design *d, int axle, double inputs[WRCD_COLUMNS], double *ratio)
{
    double *m = e->axle[axle].memory, share;
    answer usual, recent;
    moment at;

    ask_both(e, d, axle, &at, &usual, &recent);
    memcpy(inputs, usual.inputs, sizeof usual.inputs);
    *ratio = at.now;
    const word own = word_of(&usual), newest = word_of(&recent);
    const bool whole = usual.blocks * WRCD_BLOCK_TICKS >= d->window_ticks, usable = isfinite(own.sigma);
    const double step_s = STEP_TICKS * d->tick_s, new_precision = 1.0 / (own.sigma * own.sigma);
    double precision = KEPT * m[PRECISION] + WEIGHT * new_precision;
    double weighed = KEPT * m[WEIGHED] + WEIGHT * new_precision * own.log_pct;
    (void)spoken(precision, weighed, own, whole, &share);
    const bool begins = m[PRECISION] == 0.0 || share >= 1.0;
    precision = !usable ? 0.0 : begins ? BEGINS * new_precision : precision;
    weighed = !usable ? 0.0 : begins ? BEGINS * new_precision * own.log_pct : weighed;
    const double lasting_pct = 100.0 * at.lasting, in_use = isfinite(lasting_pct) ? lasting_pct : 0.0;
    const bool at_peak = in_use >= AGAIN * m[PEAK_PCT] || in_use >= SATURATED * exp(newest.log_pct);
    const double since_s = at_peak ? 0.0 : m[PEAK_AGE_S] + step_s;
    const double erodes = since_s > HOLD_S ? exp(-step_s * (1.0 / ERODES_S + e->speed_m_s / ERODES_M)) : 1.0;
    const double scatter = NEWEST * newest.sigma;
    const double apart = (newest.log_pct - weighed / precision) / sqrt(scatter * scatter + 1.0 / precision);
    const bool off = whole && usable && recent.s.live_share >= CLEAR && (apart < -WORSE || apart > BETTER);
    m[ANOTHER] = off ? m[ANOTHER] + 1.0 : 0.0;
    const bool anew = m[ANOTHER] >= ANOTHER_STEPS;
    m[PRECISION] = anew ? 0.0 : precision;
    m[WEIGHED] = anew ? 0.0 : weighed;
    m[PEAK_PCT] = at_peak ? in_use : m[PEAK_PCT] * erodes;
    m[PEAK_AGE_S] = since_s;
    if (anew)
        wrcd_window_truncate(e, axle, d->recent);
}

static const double ALLOWED = 4.0, NEWEST_SHARE = 0.5, CONTRADICTION_SHARE = 0.2, CONTRADICTION_PP = 0.3;
static const double HARSH_SHARE = 0.4, MIN_M = 2.9, BEYOND_WIDER = 2.0, LOW_FIRING = 0.2, MOVED = 0.1, COASTS = 0.1;

/* What the half-width is multiplied by, in a regime at a speed; beyond the table's speeds, that at its ends. */
static double widening(const wrcd_design *d, int regime, double speed_m_s)
{
    double of_regimes[WRCD_REGIMES];

    if (d->widening.speeds == 0)
        return 1.0;
    wrcd_table_at(&d->widening, log(speed_m_s), of_regimes);
    return of_regimes[regime];
}

/* The spread, wider where few rules fire or the inputs are unusual; and what is too much of it. */
static double doubted(const wrcd_design *d, double spread, const answer *best, double speed_m_s, wrcd_adhesion *out)
{
    double far = 0.0;

    for (int k = 0; k < MODELS; k++) {
        const double x = best->inputs[k], outside = greater(d->low[k] - x, x - d->high[k]);
        far = greater(far, outside / greater(d->high[k] - d->low[k], 1e-9));
    }
    const double few = held(LOW_FIRING / greater(best->rules.firing, 1e-9), 1.0, 3.0);
    const window_statistics *s = &best->s;
    out->doubt = s->live_share < HARSH_SHARE ? (1.0 - s->heard_share > s->heard_share - s->live_share ? WRCD_GAPS : WRCD_HARSH)
        : far > d->beyond ? WRCD_BEYOND_TRAINING
        : best->rules.rule == 0 ? WRCD_NO_RULE
        : s->ticks * d->tick_s * speed_m_s < MIN_M ? WRCD_SHORT : WRCD_NO_DOUBT;
    return spread * few * (1.0 + BEYOND_WIDER * far);
}

/* The word of the memory and the window, what has been in use lately, and how far the interval reaches. */
static double weigh(const wrcd_estimator *e, const wrcd_design *d, int axle, const moment *m, const answer *best,
                    const answer *recent, wrcd_adhesion *out)
{
    const double *memory = e->axle[axle].memory, lifts = log(3.0);
    const bool cut = best->blocks < d->usual;
    double share; /* of the window's own word: it is in the fused one */
    const word own = spoken(memory[PRECISION], memory[WEIGHED], word_of(best), !cut, &share);
    const double from_rules = exp(own.log_pct);
    const double allowed = lesser(memory[PEAK_PCT], exp(own.log_pct + lesser(ALLOWED * own.sigma, lifts)));
    const double carried = fmax(100.0 * m->lasting, allowed), mu = lesser(greater(from_rules, carried), 100.0);
    double spread = greater(SIGMAS * own.sigma, (mu - from_rules) / mu);
    const double newest_pct = fmax(recent->mu_pct, carried), reach = mu - newest_pct * (1.0 - NEWEST_SHARE * recent->spread);

    if (reach > spread * mu)
        spread = reach / mu;
    const double used = out->used_pct, *swing = best->inputs + SWING;
    const int regime = used >= d->saturated_share * mu ? 4 : cut ? 3 : used / mu < COASTS ? 2 : swing[0] + swing[1] > MOVED ? 1 : 0;
    out->regime = regime;
    out->mu_available_pct = mu;
    out->mu_from_rules_pct = from_rules;
    return doubted(d, spread * widening(d, regime, e->speed_m_s), best, e->speed_m_s, out);
}

void wrcd_estimate(const wrcd_estimator *e, const wrcd_design *d, wrcd_adhesion *adhesion)
{
    for (int axle = 0; axle < (int)e->axles; axle++) {
        wrcd_adhesion *out = &adhesion[axle];
        answer best, recent;
        moment m;
        double spread, nearest = INFINITY;
        bool unknown = false;

        ask_both(e, d, axle, &m, &best, &recent);
        out->used_pct = 100.0 * m.now;
        if (d->is_paper) {
            out->mu_from_rules_pct = best.mu_pct;
            out->mu_available_pct = isnan(best.mu_pct) ? NAN : lesser(fmax(best.mu_pct, out->used_pct), 100.0);
            out->doubt = out->regime = 0.0;
            spread = best.spread;
        } else {
            spread = weigh(e, d, axle, &m, &best, &recent, out);
        }
        const double mu = out->mu_available_pct, from_rules = out->mu_from_rules_pct, used = out->used_pct;
        out->winner = 1.0;
        for (int k = 0; k < MODELS; k++) {
            const double *c = d->centres[k], fits = (best.inputs[k] - c[0]) / (c[d->sets[k] - 1] - c[0]);
            unknown = unknown || isnan(fits);
            if (fits < nearest) {
                nearest = fits;
                out->winner = k + 1;
            }
            out->residuals[k] = sqrt(best.s.mean_square[k]);
        }
        out->winner = unknown ? 0.0 : out->winner;
        const double margin = greater(spread * from_rules, CONTRADICTION_SHARE * from_rules + CONTRADICTION_PP);
        out->torque_ratio = best.s.ratio;
        memcpy(out->inputs, best.inputs, sizeof out->inputs);
        out->fuzzy = best.rules.output;
        out->firing = best.rules.firing;
        out->rule = best.rules.rule;
        out->rule_share = best.rules.rule_share;
        out->half_width_pp = greater(spread * mu, used - from_rules);
        out->saturated = used >= d->saturated_share * mu;
        out->contradicted = used > from_rules + margin;
        out->window_s = best.s.ticks * d->tick_s;
        out->live_share = best.s.live_share;
    }
}
