/* The estimator: from the checked samples of a tick to the adhesion of every wheelset.
 *
 * A stage is a file: signals, bank, residuals, rules, memory, interval, health; estimator.c is the chain. Equations (13) to
 * (16) and Figs. 2 and 7 to 10 are those of the paper. No allocation, no globals, double throughout, every sum in a fixed
 * order: build without -ffast-math, and with -ffp-contract=off for the same bits everywhere.
 *
 *     static union { wrcd_estimator e; unsigned char bytes[WRCD_ESTIMATOR_BYTES]; } memory;
 *
 *     wrcd_begin(&memory.e, &design, AXLES);
 *     for (;;) {                                              // every design.tick_s
 *         const int says = wrcd_step(&memory.e, &design, &tick, &result);
 *         for (int axle = 0; axle < AXLES; axle++)
 *             if ((says & WRCD_NEEDS_RESET) && result.needs_reset[axle])
 *                 wrcd_reset(&memory.e, &design, axle);       // after a gap and a standstill, too
 *         wrcd_estimate(&memory.e, &design, adhesion);        // whenever one is wanted
 *     }
 *
 * What is unknown comes out as NaN. A state is copied and kept with memcpy: it holds no pointer.
 */
#ifndef WRCD_ESTIMATOR_H
#define WRCD_ESTIMATOR_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    WRCD_ABI = 2, /* of everything in this header */
    WRCD_MAX_AXLES = 8,
    WRCD_MODELS = 4,
    WRCD_CHANNELS = 2, /* yaw rate in rad/s, lateral acceleration in m/s2 */
    WRCD_MAX_STATES = 16,
    WRCD_MAX_SECTIONS = 8, /* second-order sections of a filter */
    WRCD_INPUTS = 6, /* that choose the rules: four residuals, torque, speed */
    WRCD_COLUMNS = 60, /* what the rules are given */
    WRCD_MAX_SETS = 16, /* of an input */
    WRCD_MAX_RULES = 254,
    WRCD_MAX_POLYNOMIAL = 12,
    WRCD_REGIMES = 5,
    WRCD_BLOCK_TICKS = 4, /* a window's length goes by blocks */
    WRCD_SUMS = 118, /* columns of a block's running sums */
    WRCD_LAG = 4,
    WRCD_HOLD = 4, /* ticks that innovations wait until it is known whether a pulse follows */
    WRCD_BANDS = 3, /* of the signals, for rules and pairs */
    WRCD_PAIR_FILTER = 2 * WRCD_BANDS + 4, /* states */
    WRCD_PAIR_STATES = 8,
    WRCD_PAIR_ROWS = 82, /* means of a span */
    WRCD_PAIR_SPANS = 25, /* that are kept */
    WRCD_PAIR_FEATURES = 194,
    WRCD_MAX_HIDDEN = 128,
    WRCD_REMEMBERED = 7,
    WRCD_OF_SLIDE = 5, /* what is kept of an axle's slide, and of a train's */
    WRCD_OF_SLIDES = 7
};

/* A table over growing speeds (m/s), linear between them, held at its ends: rows of `width` numbers. */
typedef struct {
    int speeds, width;
    const double *speed_m_s, *row;
} wrcd_speed_table;

/* What the design knows of pairs of sensors; matrices by rows. */
typedef struct {
    int hidden_units;
    const double *middle, *scale;        /* [FEATURES] */
    const double *hidden, *hidden_bias;  /* [FEATURES][hidden_units], [hidden_units] */
    const double *out, *out_bias;        /* [hidden_units][STATES], [STATES] */
    const double *temper, *log_prior;    /* [STATES] */
    double kept, hazard;
} wrcd_health_table;

/* A design as a table. `is_paper`: the paper's own form. Lengths are in blocks of WRCD_BLOCK_TICKS. */
typedef struct {
    double tick_s;
    int is_paper, states;
    int window_ticks, usual, longest, recent, now, step, lasts;
    double min_ticks;              /* with data, that a window must hold */
    wrcd_speed_table A, B, H, W;   /* Phi (I - K H), Phi K, H, L^-1 of each model, by rows */
    double speed_low_m_s, speed_high_m_s;
    wrcd_speed_table noise_power;  /* [MODELS][CHANNELS] that the sensors' noise leaves */
    double noise_rms[WRCD_CHANNELS];
    int lowpass_sections, highpass_sections;
    const double *lowpass, *highpass;    /* rows b0 b1 b2 1 a1 a2 */
    int sets[WRCD_INPUTS];
    const double *centres[WRCD_INPUTS];  /* growing */
    int rules, powers;
    const int *rule_sets;                /* [rules][INPUTS] */
    const double *consequents;           /* [rules][2 (COLUMNS + 1)]: slopes and offset of the output, of log10 of its spread */
    const double *low, *high;            /* [COLUMNS] that the inputs are held between */
    const double *polynomial;            /* [powers], highest first: the output to percent, (16) */
    double adhesion_low_pct, adhesion_high_pct, saturated_share, beyond;
    wrcd_speed_table changes;            /* [MODELS] decades */
    wrcd_speed_table widening;           /* [REGIMES] over log(speed); 0 speeds: none */
    const wrcd_health_table *health;     /* NULL: no pair is judged */
    const double *bands;                 /* [BANDS] sections */
    double wheelbase_m;
    int is_bogie;                        /* whether an axle's partner runs on its rail, a wheelbase before or behind */
    int longest_wheelbase_ticks;
} wrcd_design;

/* The state of an axle and of a train: F(name, dimensions). Numbers and flags are doubles. */
#define WRCD_AXLE_STATE(F)                                                                       \
    F(bank_x, [WRCD_MODELS][WRCD_MAX_STATES])                                                     \
    F(offset_mean, [WRCD_CHANNELS])                                                               \
    F(offset_count, [WRCD_CHANNELS])                                                              \
    F(gate_power, [WRCD_MODELS][WRCD_CHANNELS])                                                   \
    F(gate_peak, [WRCD_MODELS][WRCD_CHANNELS])                                                    \
    F(gate_count, [WRCD_CHANNELS])                                                                \
    F(gate_net_outliers, [WRCD_CHANNELS])                                                         \
    F(gate_last, )                                                                             \
    F(gate_age, )                                                                              \
    F(joints_highpass, [2 * WRCD_MAX_SECTIONS])                                                \
    F(joints_power, )                                                                          \
    F(joints_ticks, )                                                                          \
    F(joints_left, )                                                                           \
    F(joints_length, )                                                                         \
    F(joints_since, )                                                                          \
    F(joints_first, )                                                                          \
    F(joints_newest, )                                                                         \
    F(noise_past, [4][WRCD_CHANNELS])                                                             \
    F(noise_run, )                                                                             \
    F(noise_power, [WRCD_CHANNELS])                                                               \
    F(noise_count, [WRCD_CHANNELS])                                                               \
    F(lowpass, [2 * WRCD_MAX_SECTIONS][WRCD_MODELS * WRCD_CHANNELS])                              \
    F(complete, )                                                                              \
    F(started, )                                                                               \
    F(delayed, [WRCD_HOLD][WRCD_MODELS][WRCD_CHANNELS])                                           \
    F(delayed_live, [WRCD_HOLD])                                                                  \
    F(delayed_clear, [WRCD_HOLD])                                                                 \
    F(window_since, )                                                                          \
    F(window_first, )                                                                          \
    F(window_last, )                                                                           \
    F(window_past, [WRCD_LAG][WRCD_MODELS * WRCD_CHANNELS])                                       \
    F(memory, [WRCD_REMEMBERED])                                                                  \
    F(slide, [WRCD_OF_SLIDE])                                                                     \
    F(pair_filter, [WRCD_PAIR_FILTER][WRCD_CHANNELS])                                             \
    F(pair_mean, [WRCD_CHANNELS])                                                                 \
    F(pair_offset_ticks, )                                                                     \
    F(pair_goes_on, )                                                                          \
    F(health_rows, [WRCD_PAIR_SPANS][WRCD_PAIR_ROWS])                                             \
    F(health_held, )                                                                           \
    F(log_odds, [WRCD_PAIR_STATES])
#define WRCD_TRAIN_STATE(F)                                                                       \
    F(speed, )                                                                                 \
    F(speed_rate, )                                                                            \
    F(speed_ticks, )                                                                           \
    F(speed_m_s, )                                                                             \
    F(window_newest, )                                                                         \
    F(pair_at, )                                                                               \
    F(slides, [WRCD_OF_SLIDES])                                                                   \
    F(partner, [WRCD_MAX_AXLES]) /* the other axle of the bogie, -1: none; where else than wrcd_begin() says, set it then */ \
    F(outliers, )

#define WRCD_DECLARE(name, dimensions) double name dimensions;
typedef struct { WRCD_AXLE_STATE(WRCD_DECLARE) } wrcd_axle;

typedef struct {
    WRCD_TRAIN_STATE(WRCD_DECLARE)
    double axles;
    wrcd_axle axle[WRCD_MAX_AXLES];
    /* The bank's matrices (by columns) at the node below the speed, and their rise to the next: made when needed. */
    double node;
    double below[WRCD_MODELS][WRCD_MAX_STATES + 2][WRCD_MAX_STATES + 4];
    double rise[WRCD_MODELS][WRCD_MAX_STATES + 2][WRCD_MAX_STATES + 4];
    /* Running sums [axles][2 longest][SUMS], then the bands' newest ticks [axles][ring][BANDS][CHANNELS]. */
    double rest[];
} wrcd_estimator;
#undef WRCD_DECLARE

/* Bytes of a state: of the struct and what follows it. */
#define WRCD_STATE_BYTES(AXLES, LONGEST, LONGEST_WHEELBASE_TICKS)                                 \
    (sizeof(wrcd_estimator) + sizeof(double) * (size_t)(AXLES) * (2U * (size_t)(LONGEST) * WRCD_SUMS \
        + ((size_t)(LONGEST_WHEELBASE_TICKS) + 1U) * WRCD_BANDS * WRCD_CHANNELS))

/* One tick: arrays [channel][axle], z of what is not present is anything; |torque| / (2 N r0), NaN where unknown. Numbers
 * lie in 0 ... 2^53 and grow; where one does not, reset every axle first. The speed is finite. */
typedef struct {
    int64_t number;
    double speed_m_s;
    const double *z;
    const uint8_t *present;
    const double *torque_ratio;
} wrcd_tick;

/* What a tick brought; `live` and `calm` are of the innovation of WRCD_HOLD ticks before, which entered the window. */
typedef struct {
    double innovations[WRCD_MODELS][WRCD_CHANNELS][WRCD_MAX_AXLES];
    double whitened[WRCD_MODELS][WRCD_CHANNELS][WRCD_MAX_AXLES];
    uint8_t accepted[WRCD_MAX_AXLES], outliers[WRCD_MAX_AXLES], near_pulse[WRCD_MAX_AXLES];
    uint8_t live[WRCD_MAX_AXLES], calm[WRCD_MAX_AXLES], needs_reset[WRCD_MAX_AXLES];
} wrcd_result;
enum { WRCD_OUTLIERS = 1, WRCD_NEEDS_RESET = 2 };

/* What speaks against an estimate. */
enum wrcd_doubt { WRCD_NO_DOUBT, WRCD_NO_RULE, WRCD_BEYOND_TRAINING, WRCD_HARSH, WRCD_SHORT, WRCD_GAPS };

/* Of one axle; NaN where unknown. Adhesion in percent; half_width in percentage points, of the 90 % interval. */
#define WRCD_ESTIMATE(F)                                                                          \
    F(residuals, [WRCD_MODELS])                                                                   \
    F(torque_ratio, )                                                                          \
    F(inputs, [WRCD_COLUMNS])                                                                     \
    F(fuzzy, )                                                                                 \
    F(firing, )                                                                                \
    F(rule, )             /* that weighs most, from 1; 0 none */                               \
    F(rule_share, )                                                                            \
    F(winner, )           /* model from 1 */                                                   \
    F(mu_available_pct, )                                                                      \
    F(half_width_pp, )                                                                         \
    F(used_pct, )                                                                              \
    F(saturated, )                                                                             \
    F(contradicted, )                                                                          \
    F(doubt, )            /* enum wrcd_doubt */                                                \
    F(window_s, )                                                                              \
    F(mu_from_rules_pct, )                                                                     \
    F(live_share, )                                                                            \
    F(regime, )                                                                                \
    F(reaches_pct, )
#define WRCD_DECLARE(name, dimensions) double name dimensions;
typedef struct { WRCD_ESTIMATE(WRCD_DECLARE) } wrcd_adhesion;
#undef WRCD_DECLARE

/* Bytes of the state of so many axles (1 to WRCD_MAX_AXLES); 0: the design is larger than this header's limits. */
size_t wrcd_size(const wrcd_design *design, int axles);
void wrcd_begin(wrcd_estimator *e, const wrcd_design *design, int axles);
/* Start an axle anew: after a gap, a step of time or a standstill. */
void wrcd_reset(wrcd_estimator *e, const wrcd_design *design, int axle);
/* Returns WRCD_OUTLIERS and WRCD_NEEDS_RESET, as far as any axle has some. */
int wrcd_step(wrcd_estimator *e, const wrcd_design *design, const wrcd_tick *tick, wrcd_result *result);
void wrcd_estimate(const wrcd_estimator *e, const wrcd_design *design, wrcd_adhesion *adhesion);
/* What is likeliest of an axle's pair of sensors: 0 sound, then the design's states. */
int wrcd_pair_state(const wrcd_estimator *e, int axle);

#ifdef __cplusplus
}
#endif
#endif
