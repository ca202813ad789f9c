/* From frames to ticks while nothing happens: good frames of plain messages, ticks that nothing speaks against.
 *
 * What anything speaks against is left to Python, whole and untouched: a frame before it has changed anything, a tick
 * before it is closed. wrcd/core/lane.py lends the state to this and takes it back.
 */
#ifndef WRCD_LANE_H
#define WRCD_LANE_H

#include "wrcd_estimator.h"
#include "wrcd_frame.h"

enum { YAW, LAT, TORQUE, SPEED, BRAKE, LOAD, DIRECTION, RADIUS, WRCD_QUANTITIES };
enum {
    COUNTER_MODULO = 15, /* of E2E */
    WRCD_MAX_CYCLES = 8,
    WRCD_MIN_RUN = 4 /* equal values of a sensor that must move: from here on Python judges */
};

/* A mapped message. */
typedef struct {
    uint32_t word;
    int32_t length, is_big_endian, is_plain, is_protected, is_suspicious;
    int32_t first_signal, signals, first_ok, oks; /* of the status bits, each sound combination */
    uint64_t status_bits;
    int64_t last_us, frames;   /* of the chain of counters; frames: since the lane began */
    int32_t last, crc_start;   /* last: -1 takes any */
    uint8_t payload[8];
} wrcd_lane_message;

enum { WRCD_UNCHECKED, WRCD_STUCK_CHECKED, WRCD_JUMP_CHECKED };

/* A mapped signal, and what was seen of it. */
typedef struct {
    uint64_t mask, sign;
    double scale, offset, factor, low, high, first_end, last_end;
    int32_t shift, quantity, first_place, places;
    int32_t check, run;
    double value, share, frames, max_step;
    int64_t changed_us, timeout_us;
} wrcd_lane_signal;

/* What a frame may tell of an axle; words by their place in wrcd/core/vocabulary.py. */
#define WRCD_TOLD(F)                                                                              \
    F(VALIDITY) F(MU_AVAILABLE) F(MU_USED) F(SAMPLE_AGE) F(SURFACE) F(CONTACT_STATE) F(CONFIDENCE) \
    F(WINNING_MODEL) F(STALE_YAW_RATE) F(STALE_LAT_ACCEL) F(STALE_TORQUE) F(STALE_SPEED)          \
    F(DOMINANT_RULE) F(RESIDUAL_1) F(RESIDUAL_2) F(RESIDUAL_3) F(RESIDUAL_4) F(CAUSE)             \
    F(PLAUSIBILITY) F(OUTLIER) F(UNCHANGED) F(REACH_YAW_RATE) F(REACH_LAT_ACCEL) F(REACH_TORQUE)  \
    F(REACH_SPEED) F(REFUSED_YAW_RATE) F(REFUSED_LAT_ACCEL) F(REFUSED_TORQUE) F(REFUSED_SPEED)
#define WRCD_TELL(name) WRCD_##name,
enum wrcd_told { WRCD_TOLD(WRCD_TELL) WRCD_TOLD_COUNT };
#undef WRCD_TELL
enum { WRCD_MAX_WORDS = 32, WRCD_CAUSE_OF = WRCD_CONFIDENCE + 1, WRCD_IS_SHORT, WRCD_REPORTED };

/* A signal of a frame that is sent: where it lies, and how a number becomes its raw value; a word's bits lie ready. */
typedef struct {
    uint64_t mask, word_bits[WRCD_MAX_WORDS];
    double factor, low, high, scale, offset;
    int64_t lowest, highest, not_available;
    int32_t told, shift, is_word, rounds; /* 0 to nearest, -1 down, 1 up */
    int32_t is_rounded_down, reserved;
} wrcd_lane_field;

/* A message that is sent of an axle. */
typedef struct {
    uint64_t start;
    int64_t cycle_us;
    uint32_t word;
    int32_t axle, length, is_big_endian, is_protected, crc_start, first_field, fields;
} wrcd_lane_sent;

/* A place: a quantity of an axle. */
typedef struct {
    int64_t timeout_us, stamp_us, used_us, reach_until_us, traction_us;
    double value, waiting[2];
    int64_t waiting_us[2];
    int32_t is_mapped, waits, surplus_ticks, reach;
} wrcd_lane_place;

typedef struct {
    int64_t open, begin_us, end_us, stamp_us; /* the open tick; stamp: the newest taken */
    int64_t ticks, accepted, out_frames, out_slots;
    int64_t period_us, silence_us, forward_step_us, backward_step_us;
    int64_t cycle_us[WRCD_MAX_CYCLES];
    double min_speed_m_s, speed_low_m_s, speed_high_m_s, load_N, radius_m, dead_Nm, against_Nm, shares[4];
    int64_t traction_held_us;
    double torque_ratio[WRCD_MAX_AXLES], z[WRCD_CHANNELS * WRCD_MAX_AXLES]; /* of the newest tick */
    double surface_pct[WRCD_MAX_WORDS], confidence_pp[WRCD_MAX_WORDS], room; /* limits, as the vocabulary has them */
    int64_t sound_ticks[WRCD_MAX_AXLES], outlier_us[WRCD_MAX_AXLES], inputs_cycle_us[WRCD_MAX_AXLES];
    int64_t rejected_until_us; /* up to here it is told that a frame was refused */
    int32_t confidence[WRCD_MAX_AXLES], cause[WRCD_MAX_AXLES], standing[WRCD_MAX_AXLES]; /* of the newest slot */
    int32_t of_pair[WRCD_PAIR_STATES], of_doubt[WRCD_GAPS + 1], contradiction, too_little_data; /* causes */
    int32_t surfaces, confidences, sent, adhesions, quiet /* cycles */, window_ticks;
    int32_t axles, messages, cycles, patience, is_reverse, speed_tells_direction;
    int32_t torque_sign_counts, torque_is_total, ratio_known, shares_known, due;
} wrcd_lane;

/* Why it stopped. FRAME: Python is to take the frame; TICK: to close the open tick; SLOT: something is due at the end
 * of the tick that was just closed, by `due`, a bit for each cycle; NOTE: the estimator left a sample out, or an axle
 * needs a reset (then `due` holds as well). */
enum wrcd_lane_stop { WRCD_ALL_TAKEN, WRCD_FRAME, WRCD_TICK, WRCD_SLOT, WRCD_NOTE };

/* What a slot told of each axle at its end: up to WRCD_CONFIDENCE, the cause, and whether for too short a window. */
typedef struct {
    int64_t end_us;
    double told[WRCD_MAX_AXLES][WRCD_REPORTED];
} wrcd_lane_slot;

/* Tables and buffers, apart from the lane's own state. Frames that are made go to `made`, what slots told to `slot`. */
typedef struct {
    wrcd_lane_message *message;
    wrcd_lane_signal *signal;
    wrcd_lane_place *place;
    const int32_t *places;
    const uint64_t *oks;
    const uint8_t *crc_table;
    const wrcd_lane_sent *sent;
    const wrcd_lane_field *field;
    wrcd_frame *made;
    wrcd_lane_slot *slot;
    int64_t max_made, max_slots;
} wrcd_lane_tables;

/* How well an input is reached: a bit for each whole time-out. It is moved on to a time first. */
int wrcd_lane_reach(wrcd_lane_place *place, int64_t us);
/* Take frames until something happens; `taken` of them were. */
int wrcd_lane_run(wrcd_lane *lane, const wrcd_lane_tables *tables, wrcd_estimator *e, const wrcd_design *design,
                  wrcd_result *result, const wrcd_frame *frame, int64_t frames, int64_t *taken);
/* The frames of a slot in which every axle is Valid, or not and for the same cause, as in the slot before; false, and
 * nothing was made, where one is not. */
int wrcd_lane_tell(wrcd_lane *lane, const wrcd_lane_tables *tables, const wrcd_estimator *e, const wrcd_design *design);

#endif
