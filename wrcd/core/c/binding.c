/* What only wrcd's Python asks: numbers, and of the estimator many ticks at once and what words are made from. */
#include "fit.h"

#ifndef WRCD_SOURCES
#define WRCD_SOURCES ""
#endif
#if defined __clang__
#define COMPILER __VERSION__ /* "Clang 14.0.6" */
#elif defined __GNUC__
#define COMPILER "gcc " __VERSION__
#else
#define COMPILER "a C11 compiler"
#endif

/* The digest of the sources that setup.py compiled, and what compiled them. */
const char *wrcd_sources(void) { return WRCD_SOURCES; }
const char *wrcd_compiler(void) { return COMPILER; }

/* A number that is defined here and that Python goes by, too; NaN for another name. */
double wrcd_constant(const char *name)
{
#define NUMBER(name) {#name, name},
#define OF_HEADER(name) {#name, WRCD_##name},
    const struct { const char *name; double value; } all[] = {
        OF_HEADER(MAX_AXLES) OF_HEADER(MODELS) OF_HEADER(CHANNELS) OF_HEADER(INPUTS) OF_HEADER(COLUMNS) OF_HEADER(BLOCK_TICKS)
        OF_HEADER(SUMS) OF_HEADER(LAG) OF_HEADER(PAIR_FEATURES) OF_HEADER(MAX_STATES) OF_HEADER(MAX_RULES) OF_HEADER(MAX_SETS)
        OF_HEADER(MAX_SIGNALS) OF_HEADER(MAX_POLYNOMIAL) OF_HEADER(MAX_SECTIONS) OF_HEADER(MAX_HIDDEN)
        NUMBER(SPAN_TICKS) NUMBER(LENGTH) NUMBER(NOISE) NUMBER(SWING) NUMBER(OF_PARTNER_IN_BANDS) NUMBER(MIN_FIRING)
        NUMBER(HARSH_SHARE) NUMBER(GAPS_SHARE) NUMBER(MIN_M) NUMBER(MAX_JUMP)
        NUMBER(FORWARD_STEP_US) NUMBER(BACKWARD_STEP_US) NUMBER(TRACTION_HELD_US) NUMBER(DEAD_SHARE) NUMBER(DOUBTED)
        NUMBER(SLIDE_SAYS) NUMBER(SLIDES_KEPT) NUMBER(UNSURE) NUMBER(BRIDGED_TICKS) NUMBER(FREE_RESETS) NUMBER(FIRST_WAIT_S) NUMBER(LAST_WAIT_S)
        {"PAIR_OWN", OWN_FEATURES}, NUMBER(CERTAIN) NUMBER(MAX_FEATURE) NUMBER(SLOWEST_M_S)
        {"LOWEST_LOG_SPREAD", LOG_SPREADS[0]}, {"HIGHEST_LOG_SPREAD", LOG_SPREADS[1]},
    };
#undef OF_HEADER
#undef NUMBER

    for (size_t k = 0; k < sizeof all / sizeof *all; k++)
        if (strcmp(name, all[k].name) == 0)
            return all[k].value;
    return NAN;
}

/* Consecutive ticks: z and present [ticks][channel][axle], torque ratio [ticks][axle], speeds [ticks]. */
void wrcd_run(wrcd_estimator *e, const wrcd_design *d, int64_t number, int64_t ticks, const double *z,
                     const uint8_t *present, const double *torque_ratio, const double *speed_m_s, int resets)
{
    const int axles = (int)e->axles;
    wrcd_result result;

    for (int64_t k = 0; k < ticks; k++) {
        const ptrdiff_t two = (ptrdiff_t)k * CHANNELS * axles;
        const wrcd_tick tick = {number + k, speed_m_s[k], z + two, present + two, torque_ratio + (ptrdiff_t)k * axles};
        const int says = wrcd_step(e, d, &tick, &result);
        for (int axle = 0; resets && (says & WRCD_NEEDS_RESET) && axle < axles; axle++)
            if (result.needs_reset[axle])
                wrcd_reset(e, d, axle);
    }
}

/* What the rules are given of `count` windows of so many blocks each: all axles with one length after all with another, with
 * these torques of the moment [axle]. */
void wrcd_inputs_of(const wrcd_estimator *e, const wrcd_design *d, int count, const int64_t *blocks, const double *now,
                    double inputs[][WRCD_COLUMNS])
{
    for (int k = 0; k < count; k++) {
        const int axle = k % (int)e->axles;
        window_answer answer;
        rules_moment m;
        wrcd_rules_moment(e, d, axle, now[axle], &m);
        wrcd_rules_ask(e, d, axle, &m, (int)blocks[k], &answer);
        memcpy(inputs[k], answer.inputs, sizeof answer.inputs);
    }
}

/* Torque ratio of the moment, by axle. */
void wrcd_torque_now(const wrcd_estimator *e, const wrcd_design *d, double *ratio)
{
    for (int axle = 0; axle < (int)e->axles; axle++)
        ratio[axle] = wrcd_window_torque_now(e, d, axle);
}

/* Decades by which the newest part's residuals lie above those of the rest of the usual window. */
void wrcd_steps(const wrcd_estimator *e, const wrcd_design *d, double decades[][MODELS])
{
    double newer[SUMS], rest[SUMS];

    for (int axle = 0; axle < (int)e->axles; axle++) {
        wrcd_window_sums(e, d, axle, 0, d->recent, false, newer);
        wrcd_window_sums(e, d, axle, d->recent, d->usual, false, rest);
        wrcd_window_decades(newer, rest, d->min_ticks, decades[axle]);
    }
}

/* What pairs of sensors are judged by, after a look: features of the newest span in which an axle had data, and of the longer
 * means. */
void wrcd_features(const wrcd_estimator *e, const wrcd_design *d, double features[][WRCD_PAIR_FEATURES])
{
    for (int axle = 0; axle < (int)e->axles; axle++)
        wrcd_pair_features(&e->axle[axle], e->speed_m_s, wrcd_window_torque_now(e, d, axle), features[axle]);
}

/* Log of how much likelier each of `count` rows of features is in each state than of a sound pair. */
void wrcd_evidence(const wrcd_health_table *h, int count, const double features[][WRCD_PAIR_FEATURES],
                   double evidence[][WRCD_PAIR_STATES])
{
    for (int k = 0; k < count; k++)
        wrcd_health_evidence(h, features[k], evidence[k]);
}

/* Consecutive ticks of a bogie: z and present [ticks][SIGNALS], speeds [ticks]. What of it lasts is in the state. */
void wrcd_fit_run(const wrcd_fit_table *f, wrcd_bogie_state *b, int64_t number, int64_t ticks, const double z[][WRCD_FIT_SIGNALS],
                  const uint8_t present[][WRCD_FIT_SIGNALS], const double *speed_m_s)
{
    for (int64_t k = 0; k < ticks; k++) {
        bool is_there[WRCD_FIT_SIGNALS];
        for (int c = 0; c < WRCD_FIT_SIGNALS; c++)
            is_there[c] = present[k][c];
        wrcd_fit_step(f, b, false, number + k, z[k], is_there, speed_m_s[k]);
    }
}
