/* From the rules' word to the estimate: adhesion, how wide its interval is, and what speaks against it. */
#include "parts.h"

/* Standard deviations above the word that what was in use at the last peak may lift it, and the most: three times the word, six
 * times where little of it is in use. A torque that is lost with the rail is no slip cycle, and there the word is vague. */
static const double ALLOWED = 4.0, MOST_LIFTED = 3.0, LITTLE_LIFTED = 6.0, LITTLE = 0.5;
static const double NEWEST_SHARE = 0.5; /* of the newest part's half-width that the interval is made to reach down to */
/* More in use than the rules say there is: beyond the interval, and by this share of what they say, one is wrong. */
static const double CONTRADICTION_SHARE = 0.2, CONTRADICTION_PP = 0.3;
static const double BEYOND_WIDER = 2.0; /* the half-width grows so for each range that an input lies outside the sets */
static const double LOW_FIRING = 0.2;   /* below, few training conditions were like the moment: the interval is wider */
static const double MOVED = 0.1;  /* decades, above and below together, by which the torque has moved within half a second */
static const double COASTS = 0.1; /* of what is available: less in use shows hardly anything */

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
static double doubted(const wrcd_design *d, double spread, const window_answer *best, double speed_m_s, wrcd_adhesion *out)
{
    double far = 0.0;

    for (int k = 0; k < MODELS; k++) {
        const double x = best->inputs[k], outside = greater(d->low[k] - x, x - d->high[k]);
        far = greater(far, outside / greater(d->high[k] - d->low[k], 1e-9));
    }
    const double few = held(LOW_FIRING / greater(best->rules.firing, 1e-9), 1.0, 3.0);
    const window_statistics *s = &best->s;
    const bool is_lost = 1.0 - s->heard_share > s->heard_share - s->live_share;
    const bool is_blind = isnan(s->mean_square[0]); /* too few ticks are left for a residual */
    out->doubt = s->heard_share < GAPS_SHARE || (is_blind && is_lost) ? WRCD_GAPS
        : s->live_share < HARSH_SHARE || is_blind ? WRCD_HARSH
        : far > d->beyond ? WRCD_BEYOND_TRAINING
        : best->rules.rule == 0 ? WRCD_NO_RULE
        : s->ticks * d->tick_s * speed_m_s < MIN_M ? WRCD_SHORT : WRCD_NO_DOUBT;
    return spread * few * (1.0 + BEYOND_WIDER * far);
}

/* The word of the memory and the window, what has been in use lately, and how far the interval reaches. */
static double weigh(const wrcd_estimator *e, const wrcd_design *d, int axle, const rules_moment *m, const window_answer *best,
                    const window_answer *recent, wrcd_adhesion *out)
{
    const double *memory = e->axle[axle].memory;
    const bool cut = best->blocks < d->usual;
    double share; /* of the window's own word: it is in the fused one */
    const rail_word own = wrcd_memory_spoken(memory[PRECISION], memory[WEIGHED], wrcd_memory_word(best), !cut, &share);
    const double from_rules = exp(own.log_pct), used = out->used_pct, *swing = best->inputs + SWING;
    const double lifts = log(used < LITTLE * from_rules ? LITTLE_LIFTED : MOST_LIFTED);
    const double allowed = lesser(memory[PEAK_PCT], exp(own.log_pct + lesser(ALLOWED * own.sigma, lifts)));
    const double carried = fmax(100.0 * m->lasting, allowed), mu = lesser(greater(from_rules, carried), 100.0);
    double spread = greater(SIGMAS * own.sigma, (mu - from_rules) / mu);
    const double newest_pct = fmax(recent->mu_pct, carried);
    out->reaches_pct = newest_pct * (1.0 - NEWEST_SHARE * recent->spread);
    const double reach = mu - out->reaches_pct;

    if (reach > spread * mu)
        spread = reach / mu;
    const int regime = used >= d->saturated_share * mu ? SATURATED_NOW : cut ? CHANGED : used / mu < COASTS ? COASTING
        : swing[0] + swing[1] > MOVED ? MOVING : STEADY;
    out->regime = regime;
    out->mu_available_pct = mu;
    out->mu_from_rules_pct = from_rules;
    return doubted(d, spread * widening(d, regime, e->speed_m_s), best, e->speed_m_s, out);
}

/* From what the rules say of an axle's windows. */
void wrcd_estimate_of(const wrcd_estimator *e, const wrcd_design *d, int axle, const rules_moment *m, const window_answer *best,
                      const window_answer *recent, wrcd_adhesion *out)
{
    double spread, nearest = INFINITY;
    bool unknown = false;

    out->used_pct = 100.0 * m->now;
    if (d->is_paper) {
        out->mu_from_rules_pct = best->mu_pct;
        out->mu_available_pct = isnan(best->mu_pct) ? NAN : lesser(fmax(best->mu_pct, out->used_pct), 100.0);
        out->doubt = out->regime = 0.0;
        out->reaches_pct = NAN;
        spread = best->spread;
    } else {
        spread = weigh(e, d, axle, m, best, recent, out);
    }
    const double mu = out->mu_available_pct, from_rules = out->mu_from_rules_pct, used = out->used_pct;
    out->winner = 1.0;
    for (int k = 0; k < MODELS; k++) {
        const double *c = d->centres[k], fits = (best->inputs[k] - c[0]) / (c[d->sets[k] - 1] - c[0]);
        unknown = unknown || isnan(fits);
        if (fits < nearest) {
            nearest = fits;
            out->winner = k + 1;
        }
        out->residuals[k] = sqrt(best->s.mean_square[k]);
    }
    out->winner = unknown ? 0.0 : out->winner;
    const double margin = greater(spread * from_rules, CONTRADICTION_SHARE * from_rules + CONTRADICTION_PP);
    out->torque_ratio = best->s.ratio;
    memcpy(out->inputs, best->inputs, sizeof out->inputs);
    out->fuzzy = best->rules.output;
    out->firing = best->rules.firing;
    out->rule = best->rules.rule;
    out->rule_share = best->rules.rule_share;
    out->half_width_pp = greater(spread * mu, used - from_rules);
    out->saturated = used >= d->saturated_share * mu;
    out->contradicted = (d->is_paper ? used : 100.0 * m->lasting) > from_rules + margin;
    out->window_s = best->s.ticks * d->tick_s;
    out->live_share = best->s.live_share;
}

void wrcd_estimate(const wrcd_estimator *e, const wrcd_design *d, wrcd_adhesion *adhesion)
{
    for (int axle = 0; axle < (int)e->axles; axle++) {
        window_answer best, recent;
        rules_moment m;

        wrcd_rules_ask_both(e, d, axle, &m, &best, &recent);
        wrcd_estimate_of(e, d, axle, &m, &best, &recent, &adhesion[axle]);
        adhesion[axle].half_width_pp += wrcd_slides_pp(e, &adhesion[axle]);
    }
}
