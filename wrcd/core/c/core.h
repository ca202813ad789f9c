/* The core's stages, for its own files only: each is one file. */
#ifndef WRCD_CORE_H
#define WRCD_CORE_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "parts.h"
#include "wrcd.h"

enum { COUNTER_MODULO = 15, NO_SENDER = -1, KINDS_OF_AXLES = WRCD_DAEMON /* messages of axles come first */ };
/* What Python and its words go by, too, by wrcd_constant(). */
enum {
    FORWARD_STEP_US = 1000000, /* a stamp, or the clock, further ahead of the open tick than this is a step of time */
    BACKWARD_STEP_US = 10000,  /* out of order by less than this is jitter between queues, by more a step of the clock */
    TRACTION_HELD_US = 60000,
    /* So many ticks past a time-out are bridged. With 40 ms of both sensors missing in every 0.5 s the grid's mean error
     * grows by 6 %, with 60 ms by 10 %; the interval still holds the truth in 95 % (a stalled bus or computer does that). */
    BRIDGED_TICKS = 8,
    /* So many resets in a row are for nothing: a signal that steps resets the axle twice, when the step comes and when it
     * goes, and a second signal beside it may do so again. Then the axle waits, twice as long each time. */
    FREE_RESETS = 4
};
static const double FIRST_WAIT_S = 1.0, LAST_WAIT_S = 8.0;
/* Of 2 N r_0: so far below zero a torque may be its signal's noise, or the swing of a controller that lets go of a slipping
 * wheel. Where leaf film begins it is 0.002 for 30 ms; the noise's standard deviation is 0.0007. A torque that was larger
 * than this up to TRACTION_HELD_US ago is still taken for traction: no friction brake bites sooner. */
static const double DEAD_SHARE = 0.005;
static const double DOUBTED = 1e-6; /* chance of a run of equal values, from which on a sensor is taken to stand still */

/* Whole numbers rounded down, for times before 1970, too; b > 0. */
static inline int64_t divided(int64_t a, int64_t b) { return a / b - (a % b < 0); }
static inline int64_t remainder_of(int64_t a, int64_t b) { return a - divided(a, b) * b; }
static inline bool has(int32_t axles, int axle) { return axles >> axle & 1; }

typedef struct { double value; int32_t input; bool is_degraded, is_contested; } reading;

/* frames.c: what a frame carries, or why it is refused */
const wrcd_message *wrcd_message_of(const wrcd_train *t, uint32_t word);
uint64_t wrcd_bits_of(const wrcd_field *at, const uint8_t *data, int length);
bool wrcd_carried(const wrcd_train *t, int first, int conditions, const uint8_t *data, int length);
int wrcd_read_frame(const wrcd_train *t, int message, const wrcd_frame_head *f, int64_t room, reading *values, int *count);
bool wrcd_is_concerned(const wrcd_train *t, const wrcd_message *m, int input, const wrcd_frame_head *f, int reason);
void wrcd_forget_senders(const wrcd_train *t);

/* e2e.c */
uint8_t wrcd_crc_after(uint8_t start, const uint8_t *data, int length);
int wrcd_e2e_check(const wrcd_train *t, int message, const uint8_t *data, int length, int64_t stamp_us);
bool wrcd_e2e_suspect(const wrcd_message_state *m);
void wrcd_e2e_reset(wrcd_message_state *m);

/* plausibility.c */
/* The repeats after which a sensor is doubted of which such a share of the frames repeats; 0: one so coarse is not watched. */
int wrcd_repeats_doubted(double share);
int wrcd_plausible(const wrcd_train *t, const reading *v, int64_t stamp_us);
bool wrcd_is_unchanged(const wrcd_train *t, int input, int64_t now_us);
void wrcd_plausibility_reset(wrcd_input_state *s);

/* inputs.c */
typedef struct {
    double z[WRCD_CHANNELS * WRCD_MAX_AXLES], torque_ratio[WRCD_MAX_AXLES], speed_m_s;
    uint8_t present[WRCD_CHANNELS * WRCD_MAX_AXLES];
    int32_t stale, silent; /* axles, a bit each */
} tick_inputs;
bool wrcd_accept(const wrcd_train *t, const reading *v, int64_t stamp_us);
void wrcd_reject(const wrcd_train *t, int input, int64_t stamp_us, int reason);
void wrcd_inputs_begin(const wrcd_train *t);
void wrcd_inputs_reset(const wrcd_train *t);
void wrcd_inputs_close(const wrcd_train *t, int64_t end_us, tick_inputs *tick);
double wrcd_value_of(const wrcd_train *t, int quantity, int axle);
double wrcd_total_of(const wrcd_train *t, int quantity, int axle);
bool wrcd_torques_contradict(const wrcd_train *t, int axle);
bool wrcd_friction_share_unknown(const wrcd_train *t, int axle);
int wrcd_age_ms(const wrcd_train *t, int axle, int64_t end_us);
int wrcd_reached(const wrcd_train *t, int quantity, int axle, int64_t end_us, int *refused);
bool wrcd_any_unchanged(const wrcd_train *t, int axle, int64_t end_us);

/* validity.c */
void wrcd_tick_causes(const wrcd_train *t, const tick_inputs *tick, int64_t end_us, int32_t cause[WRCD_MAX_AXLES]);
void wrcd_validity_reset(wrcd_axle_state *a, int why);
void wrcd_validity_update(wrcd_axle_state *a, int window_ticks, int cause);
void wrcd_standing(const wrcd_axle_state *a, int window_ticks, int pair, int *has_estimate, int *cause);
int wrcd_verdict(int standing, const wrcd_adhesion *a, int *cause);
void wrcd_backoff_was_reset(const wrcd_train *t, wrcd_axle_state *a, int64_t tick);
double wrcd_backoff_wait_s(const wrcd_train *t, const wrcd_axle_state *a, int64_t tick);

/* events.c */
void wrcd_tell_cause(const wrcd_train *t, wrcd_out *out, int axle, int cause, int64_t end_us);
void wrcd_tell_jump(const wrcd_train *t, wrcd_out *out, int axle, int64_t end_us);
void wrcd_tell_outliers(const wrcd_train *t, wrcd_out *out, int axle, double yaw_rate, double wait_s, int64_t end_us);
void wrcd_tell_changes(const wrcd_train *t, wrcd_out *out, const wrcd_report *report, const bool *has_changed);

/* axles.c: what an axle says alone, the most that is in use on its rail, and whose; how many stand behind its fused word */
typedef struct { double pct, half_width_pp, used_pct, most_used_pct; int32_t most_used_axle, axles; } axle_words;
void wrcd_axles_fuse(const wrcd_train *t, wrcd_adhesion adhesion[WRCD_MAX_AXLES], axle_words own[WRCD_MAX_AXLES]);

/* slot.c */
void wrcd_pack(const wrcd_train *t, int number, int64_t counter, const double told[WRCD_TOLD_COUNT], uint8_t data[8]);
void wrcd_slot(const wrcd_train *t, wrcd_out *out, int64_t end_us);

#endif
