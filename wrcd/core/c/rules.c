/* The rules, Figs. 7 to 10: what they are given of a window, and fuzzy inference over four residuals, torque and speed. */
#include "parts.h"

static const double MIN_TORQUE = 0.003;  /* torque ratio: less is coasting, and says nothing */
static const double TORQUE_FLOOR = 0.01; /* torque ratio: what moves below this is the noise of its signal */
static const double MIN_TRACK = 0.03;    /* of the noise's power: less from the track is not distinguished from none */
static const double MAX_STEP = 1.5;      /* decades */

/* The share of the sensors' noise is what they leave in each model's residual: it goes by their noise as it is measured. */
void wrcd_rules_moment(const wrcd_estimator *e, const wrcd_design *d, int axle, double torque_now, rules_moment *m)
{
    double newer[SUMS], before[SUMS], power[MODELS * CHANNELS];
    const int half = d->usual / 2;

    m->now = torque_now;
    m->partner_counts = d->is_bogie && e->partner[axle] >= 0.0 && wrcd_pair_sound(&e->axle[(int)e->partner[axle]]);
    wrcd_window_sums(e, d, axle, d->now, d->now + d->step, true, before);
    m->lasting = fmin(torque_now, torque_of(before));
    wrcd_window_sums(e, d, axle, d->now, d->now + d->lasts, true, before);
    m->lasted = fmin(m->lasting, torque_of(before));
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
        m->floor[k] /= (double)CHANNELS;
    }
}

/* What the rules are given: log10 of residuals 1 to 3 over residual 4 and of residual 4, of torque ratio and speed; the
 * correlations; log10 of the window's length and of the noise; the torque's swing; the steps; what the signals are in bands. */
static void columns_of(const wrcd_design *d, const rules_moment *m, const window_statistics *s, double ratio,
                       const double sums[SUMS], double x[WRCD_COLUMNS])
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
    wrcd_bands_columns(sums, m->partner_counts, x + IN_BANDS);
}

/* The degrees of an input's triangular sets, which add up to one; beyond its outermost sets it counts as at their middle. */
static void degrees_of(const wrcd_design *d, int input, double x, double degree[WRCD_MAX_SETS])
{
    const double *c = d->centres[input];
    const int last = d->sets[input] - 1;

    x = held(x, c[0], c[last]);
    for (int k = 0; k <= last; k++) {
        const double rise = k == 0 ? x - (c[0] - 1.0) : (x - c[k - 1]) / (c[k] - c[k - 1]);
        const double fall = k == last ? c[last] + 1.0 - x : (c[k + 1] - x) / (c[k + 1] - c[k]);
        degree[k] = held(lesser(rise, fall), 0.0, 1.0);
    }
}

/* A rule's weight is the product of its sets' degrees; the output is the weighted mean of what the rules say: a base,
 * changed by slopes as the inputs move away from the middle of the rule's sets (Takagi's and Sugeno's form). */
void wrcd_rules_infer(const wrcd_design *d, const double inputs[WRCD_COLUMNS], rules_answer *answer)
{
    enum { SAID = 2 * (WRCD_COLUMNS + 1) };
    double degree[WRCD_INPUTS][WRCD_MAX_SETS], weight[WRCD_MAX_RULES], said[SAID] = {0.0}, firing = 0.0, most = -1.0;
    int heaviest = 0, fired[WRCD_MAX_RULES], count = 0;

    for (int i = 0; i < WRCD_INPUTS; i++)
        degrees_of(d, i, inputs[i], degree[i]);
    for (int r = 0; r < d->rules; r++) {
        const int *set = d->rule_sets + r * WRCD_INPUTS;
        weight[r] = degree[0][set[0]] * degree[1][set[1]] * (degree[2][set[2]] * degree[3][set[3]])
            * (degree[4][set[4]] * degree[5][set[5]]);
        firing += weight[r];
        fired[count] = r;
        count += weight[r] > 0.0;
        if (weight[r] > most) {
            most = weight[r];
            heaviest = r;
        }
    }
    answer->firing = firing;
    if (!(firing >= MIN_FIRING)) {
        answer->output = answer->rule_share = answer->spread = NAN;
        answer->rule = 0;
        return;
    }
    for (int k = 0; k < count; k++) {
        const double share = weight[fired[k]] /= firing, *of = d->consequents + fired[k] * SAID;
        for (int c = 0; c < SAID; c++)
            said[c] += share * of[c];
    }
    double both[2] = {said[WRCD_COLUMNS], said[SAID - 1]};
    for (int c = 0; c < WRCD_COLUMNS; c++) {
        const double x = held(inputs[c], d->low[c], d->high[c]);
        both[0] += said[c] * x;
        both[1] += said[WRCD_COLUMNS + 1 + c] * x;
    }
    answer->output = held(both[0], 0.0, 100.0);
    answer->spread = pow(10.0, held(both[1], LOG_SPREADS[0], LOG_SPREADS[1]));
    answer->rule = heaviest + 1;
    answer->rule_share = weight[heaviest];
}

/* What the rules say of the newest blocks. In a window shorter than the usual one the torque has changed: that of the moment
 * counts. (16) makes percent of their output. */
void wrcd_rules_ask(const wrcd_estimator *e, const wrcd_design *d, int axle, const rules_moment *m, int blocks,
                    window_answer *out)
{
    double sums[SUMS];

    wrcd_window_sums(e, d, axle, 0, blocks, false, sums);
    wrcd_window_statistics_of(sums, d->min_ticks, &out->s);
    columns_of(d, m, &out->s, !d->is_paper && blocks < d->usual ? m->now : out->s.ratio, sums, out->inputs);
    wrcd_rules_infer(d, out->inputs, &out->rules);
    double mu = 0.0 * out->rules.output;
    for (int k = 0; k < d->powers; k++)
        mu = mu * out->rules.output + d->polynomial[k];
    out->mu_pct = held(mu, d->adhesion_low_pct, d->adhesion_high_pct);
    out->spread = out->rules.spread;
    out->blocks = blocks;
}

/* The rules' answers of the usual window and of its newest part. What is in use counts at once as far as the newest part says
 * that it is there, all of it where that says nothing. */
void wrcd_rules_ask_both(const wrcd_estimator *e, const wrcd_design *d, int axle, rules_moment *m, window_answer *usual,
                         window_answer *recent)
{
    const int filled = wrcd_window_filled(e, d, axle);

    wrcd_rules_moment(e, d, axle, wrcd_window_torque_now(e, d, axle), m);
    wrcd_rules_ask(e, d, axle, m, filled < d->usual ? filled : d->usual, usual);
    if (d->is_paper)
        return;
    wrcd_rules_ask(e, d, axle, m, filled < d->recent ? filled : d->recent, recent);
    m->lasting = fmax(m->lasted, fmin(m->lasting, recent->mu_pct / 100.0));
}
