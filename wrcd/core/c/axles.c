/* The axles of a train on one rail share their words.
 *
 * An axle's word holds of the rail from where its memory began to where it stands. Two axles are on one rail where no
 * memory began between them, and none of them that is ahead is saturated: slip cleans a rail.
 * On one rail the words are averaged in log adhesion, each weighed by its spread. A word far from the axle's own is of
 * another rail or of broken sensors: it counts less, and then not at all. What is wrong in one word is partly wrong in
 * the others: the interval is no narrower for their number. It reaches as far down as the axle's own newest part says.
 * What one of them uses ahead is available here, not the other way round.
 * A saturated axle keeps its own word. Where axles ahead have found a worse rail, this one goes by them as soon as it
 * stands on it. */
#include "core.h"

static const double LATE_S = 0.3;        /* by so much axles may find one change of the rail apart */
static const double LEAST_SPREAD = 0.03; /* no word weighs more than one of such a half-width, over the adhesion */
/* Standard deviations, of both: a word so far from the own does not count, one that is nearer by one counts in full. */
static const double DISAGREE = 2.5;
static const double WORSE = 1.0;         /* standard deviations, of both, that a worse rail's words lie below the own */

typedef struct { double place_m, began_m, log_pct, spread; } axle_word;
typedef struct { axle_word of[WRCD_MAX_AXLES]; double late_m; int32_t speak, saturated; int axles; } train_words;

static train_words heard(const wrcd_train *t, const wrcd_adhesion adhesion[WRCD_MAX_AXLES])
{
    train_words w = {.late_m = LATE_S * t->estimator->speed_m_s, .axles = t->settings->axles};

    for (int k = 0; k < w.axles; k++) {
        const wrcd_adhesion *a = &adhesion[k];
        const bool is_reverse = wrcd_value_of(t, WRCD_DIRECTION, k) < 0.0;
        const double place_m = is_reverse ? -t->settings->position_m[k] : t->settings->position_m[k];
        int cause;
        const bool is_valid = t->axle[k].has_estimate && wrcd_verdict(t->axle[k].standing, a, &cause) == WRCD_VALID;
        const double since_m = t->estimator->axle[k].memory[SINCE_M];
        if (!is_valid || !(a->mu_available_pct > 0.0) || !isfinite(place_m + since_m + a->half_width_pp + a->used_pct))
            continue;
        w.speak |= 1 << k;
        w.saturated |= a->saturated > 0.0 ? 1 << k : 0;
        w.of[k] = (axle_word){
            place_m, place_m - since_m, log(a->mu_available_pct),
            fmax(a->half_width_pp / a->mu_available_pct, LEAST_SPREAD)};
    }
    return w;
}

static bool on_one_rail(const train_words *w, int a, int b)
{
    const double low = fmin(w->of[a].place_m, w->of[b].place_m), high = fmax(w->of[a].place_m, w->of[b].place_m);
    bool is_one = true;

    for (int k = 0; k < w->axles; k++) {
        const axle_word *of = &w->of[k];
        const bool cleans = has(w->saturated, k) && of->place_m > low && of->place_m <= high;
        const bool begins = of->began_m > low + w->late_m && of->began_m <= high;
        is_one = is_one && !(has(w->speak, k) && (cleans || begins));
    }
    return a == b || is_one;
}

static double sigmas_apart(axle_word a, axle_word b)
{
    return SIGMAS * (a.log_pct - b.log_pct) / sqrt(a.spread * a.spread + b.spread * b.spread);
}

/* Of words that count so much, each weighed by its spread: the mean, and the mean of their spreads. */
static axle_word mean_of(const train_words *w, const double counts[WRCD_MAX_AXLES])
{
    axle_word sum = {0};
    double weight = 0.0;

    for (int k = 0; k < w->axles; k++) {
        const double one = counts[k] > 0.0 ? counts[k] / (w->of[k].spread * w->of[k].spread) : 0.0;
        weight += one;
        sum.log_pct += one * w->of[k].log_pct;
        sum.spread += one * w->of[k].spread;
    }
    return (axle_word){NAN, NAN, sum.log_pct / weight, sum.spread / weight};
}

/* The word that an axle goes by, and what counts in it: its own, or those that have found a worse rail ahead. */
static axle_word goes_by(const train_words *w, int axle, int32_t ahead, double counts[WRCD_MAX_AXLES])
{
    const axle_word own = w->of[axle];
    double newer[WRCD_MAX_AXLES] = {0.0};

    for (int k = 0; k < w->axles; k++)
        newer[k] = has(ahead, k) && w->of[k].began_m > own.began_m && w->of[k].began_m <= own.place_m + w->late_m;
    const axle_word found = mean_of(w, newer); /* NaN of none */
    const bool is_worse = sigmas_apart(own, found) > WORSE;
    memset(counts, 0, sizeof newer);
    counts[axle] = 1.0;
    if (is_worse)
        memcpy(counts, newer, sizeof newer);
    return is_worse ? found : own;
}

static void fuse(const wrcd_train *t, const train_words *w, int axle, wrcd_adhesion *out, axle_words *own)
{
    axle_words *mine = &own[axle];
    int32_t here = 0, ahead = 0;
    double counts[WRCD_MAX_AXLES];

    for (int k = 0; k < w->axles; k++)
        if (has(w->speak & ~w->saturated, axle) && has(w->speak, k) && on_one_rail(w, axle, k)) {
            here |= 1 << k;
            ahead |= w->of[k].place_m > w->of[axle].place_m ? 1 << k : 0;
        }
    const axle_word by = goes_by(w, axle, ahead, counts);
    const bool by_own = counts[axle] > 0.0;
    double bound = mine->used_pct;
    mine->axles = 0;
    for (int k = 0; k < w->axles; k++) {
        if (has(here, k))
            counts[k] = fmax(counts[k], held(DISAGREE - fabs(sigmas_apart(w->of[k], by)), 0.0, 1.0));
        mine->axles += counts[k] > 0.0;
        if (!has(ahead, k) || !(counts[k] > 0.0))
            continue;
        if (own[k].used_pct > mine->most_used_pct) {
            mine->most_used_pct = own[k].used_pct;
            mine->most_used_axle = t->settings->number[k];
        }
        bound = by_own ? fmax(bound, own[k].used_pct) : bound;
    }
    if (by_own && mine->axles == 1)
        return;
    const axle_word mean = mean_of(w, counts);
    const double word_pct = exp(mean.log_pct), mu = fmin(fmax(word_pct, bound), 100.0);
    const double lowest = by_own ? fmin(word_pct, out->reaches_pct) : word_pct;
    out->mu_available_pct = mu;
    out->half_width_pp = fmax(mean.spread * mu, mu - lowest);
}

void wrcd_axles_fuse(const wrcd_train *t, wrcd_adhesion adhesion[WRCD_MAX_AXLES], axle_words own[WRCD_MAX_AXLES])
{
    for (int k = 0; k < t->settings->axles; k++) {
        const wrcd_adhesion *a = &adhesion[k];
        const double used = isnan(a->used_pct) ? NAN : fmin(a->used_pct, 100.0);
        own[k] = (axle_words){a->mu_available_pct, a->half_width_pp, used, used, t->settings->number[k], 1};
    }
    if (!t->settings->is_placed || t->design->is_paper)
        return;
    const train_words w = heard(t, adhesion);
    for (int k = 0; k < w.axles; k++)
        if (has(w.speak, k))
            fuse(t, &w, k, &adhesion[k], own);
}
