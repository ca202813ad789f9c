/* What slides reveal. Where more is asked of a wheelset and it slides, what is in use is what the rail bears: the estimate before
 * is compared with it, of all axles of a train and over hours. Where the estimates are biased the intervals are wider, as far as
 * they are off; the estimate itself stays as it is, for the bias of another rail may be another. */
#include "parts.h"

static const double MOST_USED = 0.85; /* of an estimate: with more in use it is known without the rules */
/* Only so many times as much in use as before is what the driver asked for; else the rail may have become worse. */
static const double RISES = 1.2;
static const double HOLDS_S = 0.4;    /* so long a wheelset slides before its torque is what the rail bears */
/* A slide ends as less is in use than it showed; else the estimate was late, and has found more. */
static const double ENDS = 0.9;
static const double BEFORE_S = 6.0;   /* the estimate is no older than that as the slide begins */
static const double TOGETHER_S = 5.0; /* axles that slide within it are one observation */
/* Slides of vehicles as trained scatter so (log adhesion); that counts for so many slides. */
static const double OWN_SIGMA = 0.15, OWN_SLIDES = 6.0;
static const double LEAST = 3.5, SURE = 3.0; /* weight of the slides, and standard errors, from which on a bias counts */
static const double FULLY = 0.3;             /* the bias counts in full where so much less than MOST_USED is in use */

static void judge(double s[WRCD_OF_SLIDES])
{
    const double n = s[SLIDES], mean = s[SUM] / n;
    const double variance = (s[SQUARES] - n * mean * mean + OWN_SLIDES * OWN_SIGMA * OWN_SIGMA) / (n + OWN_SLIDES - 1.0);
    s[BIAS] = n >= LEAST && fabs(mean) > SURE * sqrt(variance / n) ? mean : 0.0;
}

static void sum_up(double s[WRCD_OF_SLIDES])
{
    const double of = s[TOGETHER] / s[AXLES];

    s[SLIDES] = SLIDES_KEPT * s[SLIDES] + 1.0;
    s[SUM] = SLIDES_KEPT * s[SUM] + of;
    s[SQUARES] = SLIDES_KEPT * s[SQUARES] + of * of;
    s[AXLES] = s[TOGETHER] = s[TOGETHER_AGE_S] = 0.0;
    judge(s);
}

/* Go on from what was kept: weight, sum and squares. */
void wrcd_slides_take(wrcd_estimator *e, const double kept[3])
{
    memset(e->slides, 0, sizeof e->slides);
    memcpy(e->slides, kept, 3 * sizeof *kept);
    judge(e->slides);
}

/* An axle's slide, and the estimate before it, do not count: its inputs are doubted. */
void wrcd_slides_forget(wrcd_estimator *e, int axle) { memset(e->axle[axle].slide, 0, sizeof e->axle[axle].slide); }

/* A step later: what is estimated of an axle, and the torque ratio that has lasted. */
void wrcd_slides_look(wrcd_estimator *e, int axle, const wrcd_adhesion *now, double lasted, double step_s)
{
    double *s = e->axle[axle].slide, *all = e->slides;

    if (!wrcd_pair_sound(&e->axle[axle]) || !isfinite(lasted)) {
        wrcd_slides_forget(e, axle);
        return;
    }
    s[BEFORE_AGE_S] += s[BEFORE_PCT] > 0.0 ? step_s : 0.0;
    if (!(now->mu_available_pct > 0.0)) /* no rule fires: it may be the change itself */
        return;
    if (now->saturated > 0.0) {
        s[HELD_S] += step_s;
        s[SHOWN_PCT] = s[HELD_S] > HOLDS_S ? greater(s[SHOWN_PCT], 100.0 * lasted) : 0.0;
        return;
    }
    if (s[BEFORE_PCT] > 0.0 && s[BEFORE_AGE_S] - s[HELD_S] <= BEFORE_S && s[SHOWN_PCT] > RISES * s[USED_PCT]
        && now->used_pct < ENDS * s[SHOWN_PCT]) {
        all[TOGETHER] += held(log(s[BEFORE_PCT] / s[SHOWN_PCT]), -SLIDE_SAYS, SLIDE_SAYS);
        all[AXLES] += 1.0;
        s[BEFORE_PCT] = 0.0;
    }
    s[HELD_S] = s[SHOWN_PCT] = 0.0;
    if (!wrcd_is_steady(now) || now->used_pct >= MOST_USED * now->mu_available_pct)
        return;
    s[BEFORE_PCT] = now->mu_available_pct;
    s[USED_PCT] = now->used_pct;
    s[BEFORE_AGE_S] = 0.0;
}

/* The end of that step: axles that slide together are counted. */
void wrcd_slides_end(wrcd_estimator *e, double step_s)
{
    double *s = e->slides;

    if (s[AXLES] == 0.0)
        return;
    s[TOGETHER_AGE_S] += step_s;
    if (s[TOGETHER_AGE_S] >= TOGETHER_S)
        sum_up(s);
}

/* By how much an estimate may be off (percentage points). */
double wrcd_slides_pp(const wrcd_estimator *e, const wrcd_adhesion *now)
{
    const double bias = e->slides[BIAS], used = now->used_pct / now->mu_available_pct * exp(lesser(bias, 0.0));

    return bias == 0.0 ? 0.0 : fabs(1.0 - exp(-bias)) * now->mu_available_pct * held((MOST_USED - used) / FULLY, 0.0, 1.0);
}
