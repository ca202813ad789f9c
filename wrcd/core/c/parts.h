/* The estimator's stages, for its own files only. */
#ifndef WRCD_PARTS_H
#define WRCD_PARTS_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "wrcd_estimator.h"

#if defined __FAST_MATH__ || defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__
#error "build without -ffast-math: what is unknown is NaN"
#endif

enum { MODELS = WRCD_MODELS, CHANNELS = WRCD_CHANNELS, W = WRCD_MODELS * WRCD_CHANNELS, YAW = 0, LAT = 1, BANDS = WRCD_BANDS };

/* What designs and words in Python go by, too, by wrcd_constant(). */
enum { REMEMBER_TICKS = 16, SPAN_TICKS = 48 }; /* from one word that is fused, and one look at the sensors, to the next */
/* Where among what the rules are given correlations, noise, the torque's swing and the residuals' steps begin. */
enum {
    LAG = WRCD_INPUTS, CROSS = LAG + W, LENGTH = CROSS + MODELS, NOISE, SWING = NOISE + CHANNELS, STEP = SWING + 2,
    IN_BANDS = STEP + 4, OF_PARTNER_IN_BANDS = IN_BANDS + 3 * BANDS, BAND_COLUMNS = (3 + 8) * BANDS,
    GIVEN_COLUMNS = IN_BANDS /* that pairs are judged by, too */
};
_Static_assert((int)IN_BANDS + (int)BAND_COLUMNS == (int)WRCD_COLUMNS, "what the rules are given");
/* Below this total firing no rule speaks for the moment: the answer is "I don't know", not a guess. */
static const double MIN_FIRING = 0.05;
static const double LOG_SPREADS[2] = {-2.7, 0.3}; /* no interval is narrower or wider than this, over the adhesion (log10) */
static const double HARSH_SHARE = 0.1, GAPS_SHARE = 0.4; /* least of the window far from pulses; least with data */
static const double MIN_M = 2.9;       /* the least way that a wheelset must have run for an estimate */
static const double CERTAIN = 14.0;    /* log odds of a pair's state: no more than this is kept */
static const double MAX_FEATURE = 5.0; /* standard deviations of a feature of a pair */
static const double SLOWEST_M_S = 3.0; /* slower, a wheelbase takes longer than is kept */
/* Whatever the innovations say: no wheelset's yaw rate (rad/s) changes by so much within a tick; 0.061 is the most in 3000
 * runs, at a drop from dry to leaf film. */
static const double MAX_JUMP = 0.08;

/* As numpy's maximum and minimum: NaN wins. */
static inline double greater(double a, double b) { return a > b || isnan(a) ? a : b; }
static inline double lesser(double a, double b) { return a < b || isnan(a) ? a : b; }
static inline double held(double x, double low, double high) { return lesser(greater(x, low), high); }

/* bank.c */
double wrcd_speed_step(wrcd_estimator *e, const wrcd_design *d, double speed_m_s);
void wrcd_table_at(const wrcd_speed_table *table, double speed, double *row);
typedef struct { double m[MODELS][WRCD_MAX_STATES + CHANNELS][WRCD_MAX_STATES + 2 * CHANNELS]; } bank_matrices;
void wrcd_bank_at(wrcd_estimator *e, const wrcd_design *d, double speed_m_s, bank_matrices *at);
void wrcd_bank_step(const bank_matrices *at, int states, double x[MODELS][WRCD_MAX_STATES], const double z[CHANNELS],
               bool present, double innovation[MODELS][CHANNELS], double whitened[MODELS][CHANNELS]);

/* signals.c */
void wrcd_sections_step(const double *sections, int count, double *x, int channels, double *signal);
void wrcd_offset_step(wrcd_axle *a, double ticks, const double z[CHANNELS], bool learns, double deviation[CHANNELS]);
void wrcd_gate_outliers(const wrcd_axle *a, const double e[MODELS][CHANNELS], double yaw_rate, bool there, bool out[CHANNELS]);
bool wrcd_gate_learn(wrcd_axle *a, const double e[MODELS][CHANNELS], double yaw_rate, bool used, const bool out[CHANNELS]);
bool wrcd_joints_step(wrcd_axle *a, const wrcd_design *d, double lat_accel, bool present, bool *near_pulse);
bool wrcd_joints_recovering(const wrcd_axle *a);
extern const double WRCD_MAX_PULSE[CHANNELS];
void wrcd_noise_step(wrcd_axle *a, const wrcd_design *d, const double z[CHANNELS], bool used);
void wrcd_noise_sensor_factor(const wrcd_axle *a, double factor[CHANNELS]);
void wrcd_signals_reset(wrcd_axle *a, const wrcd_design *d);
void wrcd_gate_why(const wrcd_estimator *e, int axle, const double innovation[MODELS][CHANNELS], double yaw_rate,
                   double why[2 * CHANNELS + 1]);

/* residuals.c: columns of a block's running sums */
enum {
    N, HEARD, LIVE, T, TT, SUM_W, SUM_TW = SUM_W + W, SUM_WW = SUM_TW + W, SUM_LAG = SUM_WW + W, SUM_CROSS = SUM_LAG + W,
    RATIO = SUM_CROSS + MODELS, RATIO_N, RAW_N, SUM_RAW, SUM_RAW2 = SUM_RAW + W,
    BAND_N = SUM_RAW2 + W, SUM_FINE, PLAIN = SUM_FINE + CHANNELS, OWN_POWER = PLAIN + 2 * CHANNELS,
    OWN_CROSS = OWN_POWER + 2 * BANDS, OWN_APART = OWN_CROSS + BANDS, THEIR_POWER = OWN_APART + 2 * BANDS,
    SUM_ACROSS = THEIR_POWER + 2 * BANDS, SUM_NOW = SUM_ACROSS + 8 * BANDS, SUMS = SUM_NOW + 2 * BANDS
};
_Static_assert((int)SUMS == (int)WRCD_SUMS, "room for the sums");
typedef struct {
    double mean_square[MODELS], lag[W], cross[MODELS], ratio, ticks, heard_share, live_share;
} window_statistics;
void wrcd_window_move(wrcd_estimator *e, const wrcd_design *d, int64_t block);
typedef struct { bool running, heard, live, calm; double ratio; } window_tick;
void wrcd_window_put(wrcd_estimator *e, const wrcd_design *d, int axle, int64_t tick, const double w[W], const double raw[W],
                window_tick is);
void wrcd_window_reset(wrcd_estimator *e, const wrcd_design *d, int axle);
double *wrcd_window_row(wrcd_estimator *e, const wrcd_design *d, int axle, int row);
double *wrcd_window_newest(wrcd_estimator *e, const wrcd_design *d, int axle);
void wrcd_window_truncate(wrcd_estimator *e, int axle, int blocks);
int wrcd_window_filled(const wrcd_estimator *e, const wrcd_design *d, int axle);
/* Sums over the blocks first ... end - 1, counted back from the newest; past_change: what lies before one, too. */
void wrcd_window_sums(const wrcd_estimator *e, const wrcd_design *d, int axle, int first, int end, bool past_change,
                 double sums[SUMS]);
static inline double torque_of(const double sums[SUMS]) { return sums[RATIO] / sums[RATIO_N]; }
double wrcd_window_torque_now(const wrcd_estimator *e, const wrcd_design *d, int axle);
void wrcd_window_torque_range(const wrcd_estimator *e, const wrcd_design *d, int axle, int blocks, double range[2]);
void wrcd_window_statistics_of(const double sums[SUMS], double min_ticks, window_statistics *s);
void wrcd_window_decades(const double newer[SUMS], const double rest[SUMS], double min_ticks, double decades[MODELS]);

/* rules.c */
typedef struct { double output, firing, rule_share, spread; int rule; } rules_answer;
void wrcd_rules_infer(const wrcd_design *d, const double inputs[WRCD_COLUMNS], rules_answer *answer);
typedef struct { /* of an axle at one moment, whatever the window's length */
    double now, lasting, lasted, range[2], step[MODELS], noise_factor[CHANNELS], floor[MODELS], grid_speed_m_s;
    bool partner_counts; /* its signals, beside the axle's own */
} rules_moment;
typedef struct { /* what the rules say of one window: adhesion, and its half-width as a share of it */
    double mu_pct, spread, inputs[WRCD_COLUMNS];
    int blocks;
    window_statistics s;
    rules_answer rules;
} window_answer;
void wrcd_rules_moment(const wrcd_estimator *e, const wrcd_design *d, int axle, double torque_now, rules_moment *m);
void wrcd_rules_ask(const wrcd_estimator *e, const wrcd_design *d, int axle, const rules_moment *m, int blocks,
                    window_answer *out);
void wrcd_rules_ask_both(const wrcd_estimator *e, const wrcd_design *d, int axle, rules_moment *m, window_answer *usual,
                         window_answer *recent);

/* memory.c */
static const double SIGMAS = 1.645; /* in the half-width of a 90 % interval */
enum { PRECISION, WEIGHED, PEAK_PCT, PEAK_AGE_S, ANOTHER, SINCE_M, ABOVE_S }; /* what is remembered */
typedef struct { double log_pct, sigma; } rail_word;
rail_word wrcd_memory_word(const window_answer *a);
rail_word wrcd_memory_spoken(double precision, double weighed, rail_word own, bool whole, double *share);
bool wrcd_memory_fuse(double memory[WRCD_REMEMBERED], rail_word own, bool whole, rail_word newest, double live_share,
                      double in_use_pct, double step_s, double speed_m_s);
void wrcd_memory_changes(wrcd_estimator *e, const wrcd_design *d, int axle);
void wrcd_memory_remember(wrcd_estimator *e, const wrcd_design *d, int axle, double inputs[WRCD_COLUMNS], double *ratio);

/* interval.c */
enum { STEADY, MOVING, COASTING, CHANGED, SATURATED_NOW }; /* what goes on: the last that applies counts */
void wrcd_estimate_of(const wrcd_estimator *e, const wrcd_design *d, int axle, const rules_moment *m, const window_answer *best,
                      const window_answer *recent, wrcd_adhesion *out);
/* Whether nothing goes on, and nothing speaks against the estimate. */
static inline bool wrcd_is_steady(const wrcd_adhesion *a)
{
    return (int)a->regime == STEADY && (int)a->doubt == WRCD_NO_DOUBT && !(a->contradicted > 0.0);
}

/* slides.c */
/* A slide says at most a factor of two: a rail that changes in these seconds says as much as a bias. At each those before keep so
 * much of their weight. */
static const double SLIDE_SAYS = 0.7, SLIDES_KEPT = 0.98;
enum { BEFORE_PCT, USED_PCT, BEFORE_AGE_S, HELD_S, SHOWN_PCT };            /* of an axle's slide: the estimate before, what was in use */
enum { SLIDES, SUM, SQUARES, BIAS, AXLES, TOGETHER, TOGETHER_AGE_S };      /* of all: sums of log (before / shown); those not yet in */
void wrcd_slides_look(wrcd_estimator *e, int axle, const wrcd_adhesion *now, double lasted, double step_s);
void wrcd_slides_forget(wrcd_estimator *e, int axle);
void wrcd_slides_end(wrcd_estimator *e, double step_s);
void wrcd_slides_take(wrcd_estimator *e, const double kept[3]);
double wrcd_slides_pp(const wrcd_estimator *e, const wrcd_adhesion *now);

/* bands.c */
static const double BAND_FLOOR = 0.02; /* of the noise's power, in each band */
extern const int WRCD_ACROSS[4][2];    /* own signal, partner's */
void wrcd_bands_step(wrcd_estimator *e, const wrcd_design *d, int axle, const double z[CHANNELS], bool used);
void wrcd_bands_end_of_tick(wrcd_estimator *e, const wrcd_design *d);
void wrcd_bands_reset(wrcd_estimator *e, const wrcd_design *d, int axle);
void wrcd_bands_columns(const double sums[SUMS], bool partner_counts, double x[BAND_COLUMNS]);

/* health.c */
bool wrcd_pair_sound(const wrcd_axle *a);
void wrcd_pair_features(const wrcd_axle *a, double speed_m_s, double ratio, double x[WRCD_PAIR_FEATURES]);
void wrcd_health_look(wrcd_estimator *e, const wrcd_design *d, const double inputs[][WRCD_COLUMNS], const double *ratio);
enum { OWN_FEATURES = 3 * BANDS + 2 * CHANNELS }; /* of a pair's own signals */
void wrcd_health_evidence(const wrcd_health_table *h, const double x[WRCD_PAIR_FEATURES], double evidence[WRCD_PAIR_STATES]);

void wrcd_health_figures(const wrcd_estimator *e, int axle, double p[WRCD_PAIR_STATES], double figures[5]);

#endif
