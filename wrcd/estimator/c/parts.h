/* The estimator's parts, for its own files only. Each has its numpy twin, named beside it. */
#ifndef WRCD_PARTS_H
#define WRCD_PARTS_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "wrcd_estimator.h"

enum { MODELS = WRCD_MODELS, CHANNELS = WRCD_CHANNELS, W = WRCD_MODELS * WRCD_CHANNELS, YAW = 0, LAT = 1 };

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

/* window.c: columns of the running sums */
enum {
    N, HEARD, LIVE, T, TT, SUM_W, SUM_TW = SUM_W + W, SUM_WW = SUM_TW + W, SUM_LAG = SUM_WW + W, SUM_CROSS = SUM_LAG + W,
    RATIO = SUM_CROSS + MODELS, RATIO_N, RAW_N, SUM_RAW, SUM_RAW2 = SUM_RAW + W, SUMS = SUM_RAW2 + W
};
typedef struct {
    double mean_square[MODELS], lag[W], cross[MODELS], ratio, ticks, heard_share, live_share;
} window_statistics;
void wrcd_window_move(wrcd_estimator *e, const wrcd_design *d, int64_t block);
typedef struct { bool running, heard, live, calm; double ratio; } window_tick;
void wrcd_window_put(wrcd_estimator *e, const wrcd_design *d, int axle, int64_t tick, const double w[W], const double raw[W],
                window_tick is);
void wrcd_window_reset(wrcd_estimator *e, const wrcd_design *d, int axle);
void wrcd_window_truncate(wrcd_estimator *e, int axle, int blocks);
int wrcd_window_filled(const wrcd_estimator *e, const wrcd_design *d, int axle);
/* Sums over the blocks first ... end - 1, counted back from the newest; past_change: what lies before one, too. */
void wrcd_window_sums(const wrcd_estimator *e, const wrcd_design *d, int axle, int first, int end, bool past_change,
                 double sums[SUMS]);
void wrcd_window_torque_range(const wrcd_estimator *e, const wrcd_design *d, int axle, int blocks, double range[2]);
void wrcd_window_statistics_of(const double sums[SUMS], double min_ticks, window_statistics *s);
void wrcd_window_decades(const double newer[SUMS], const double rest[SUMS], double min_ticks, double decades[MODELS]);

/* rules.c */
typedef struct { double output, firing, rule_share, spread; int rule; } rules_answer;
void wrcd_rules_infer(const wrcd_design *d, const double inputs[WRCD_COLUMNS], rules_answer *answer);

/* answer.c */
double wrcd_answer_torque_now(const wrcd_estimator *e, const wrcd_design *d, int axle);
void wrcd_answer_inputs_of(const wrcd_estimator *e, const wrcd_design *d, int axle, int blocks, double now,
                      double inputs[WRCD_COLUMNS]);
void wrcd_answer_changes(wrcd_estimator *e, const wrcd_design *d, int axle);
void wrcd_answer_remember(wrcd_estimator *e, const wrcd_design *d, int axle, double inputs[WRCD_COLUMNS], double *ratio);

/* pair.c */
void wrcd_pair_step(wrcd_estimator *e, const wrcd_design *d, int axle, const double z[CHANNELS], bool used);
void wrcd_pair_end_of_tick(wrcd_estimator *e, const wrcd_design *d);
void wrcd_pair_reset(wrcd_estimator *e, const wrcd_design *d, int axle);
void wrcd_pair_features(const wrcd_axle *a, double speed_m_s, double ratio, double x[WRCD_PAIR_FEATURES]);
void wrcd_health_look(wrcd_estimator *e, const wrcd_design *d, const double inputs[][WRCD_COLUMNS], const double *ratio);

#endif
