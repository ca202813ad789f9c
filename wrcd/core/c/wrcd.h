/* The core of a train: CAN frames in, adhesion frames out. Bytes and times are arguments: no clock, no socket, no file,
 * no globals, no allocation.
 *
 * A `wrcd_train` names the tables, which Python or a generated file makes from configuration, DBC and design, and the
 * state. The state is one piece of memory; it is copied with memcpy. What comes of frames and time lies in the buffers of
 * `wrcd_out`: frames, reports of axles, events. Records are lists of F(type, name, dimensions), so that others may read
 * their layout (binding.c). Times are microseconds since 1970.
 */
#ifndef WRCD_H
#define WRCD_H

#include "wrcd_estimator.h"
#include "wrcd_frame.h"

#ifdef __cplusplus
extern "C" {
#endif

#define WRCD_NEVER (-((int64_t)1 << 60))

enum { WRCD_YAW, WRCD_LAT, WRCD_TORQUE, WRCD_SPEED, WRCD_BRAKE, WRCD_LOAD, WRCD_DIRECTION, WRCD_RADIUS, WRCD_QUANTITIES };
enum { WRCD_UNSIGNED, WRCD_SIGNED, WRCD_FLOAT };

/* Why a frame is not accepted; the names and their order are wrcd/bus/reasons.py's. */
enum wrcd_reason {
    WRCD_REASON_NONE, WRCD_REASON_KIND, WRCD_REASON_LENGTH, WRCD_REASON_CRC, WRCD_REASON_DATA_ID, WRCD_REASON_REPEAT,
    WRCD_REASON_COUNTER, WRCD_REASON_TWO_SENDERS, WRCD_REASON_STATUS, WRCD_REASON_RANGE, WRCD_REASON_NOT_FINITE,
    WRCD_REASON_STUCK, WRCD_REASON_JUMP, WRCD_REASONS
};

/* Why an axle is not Valid; the names and their order are wrcd/core/causes.py's. */
enum wrcd_cause {
    WRCD_CAUSE_NONE, WRCD_CAUSE_WARMING_UP, WRCD_CAUSE_STANDSTILL, WRCD_CAUSE_INPUT_SILENT, WRCD_CAUSE_RESTARTED,
    WRCD_CAUSE_INPUT_STALE, WRCD_CAUSE_TWO_SENDERS, WRCD_CAUSE_SENSOR_DEGRADED, WRCD_CAUSE_UNCHANGED,
    WRCD_CAUSE_SPEED_OUT_OF_RANGE, WRCD_CAUSE_FRICTION_SHARE_UNKNOWN, WRCD_CAUSE_LOAD_BEYOND, WRCD_CAUSE_RADIUS_BEYOND,
    WRCD_CAUSE_SENSORS_SILENT, WRCD_CAUSE_GYRO_REVERSED, WRCD_CAUSE_SENSORS_UNRELATED, WRCD_CAUSE_ACCEL_SMALL,
    WRCD_CAUSE_GYRO_DEAD, WRCD_CAUSE_TOO_LITTLE_DATA, WRCD_CAUSE_NO_RULE, WRCD_CAUSE_BEYOND_TRAINING, WRCD_CAUSE_HARSH,
    WRCD_CAUSE_CONTRADICTION, WRCD_CAUSE_TORQUES_CONTRADICT, WRCD_CAUSE_WHEELSET_UNLIKE /* reserved */, WRCD_CAUSES
};
enum wrcd_validity { WRCD_NOT_AVAILABLE, WRCD_VALID, WRCD_DEGRADED };

/* Where a number lies in a frame: counted from the lowest bit of the frame as one whole number, its first byte lowest
 * (little-endian) or highest. */
#define WRCD_FIELD(F) F(int32_t, shift, ) F(int32_t, bits, ) F(int32_t, is_big_endian, ) F(int32_t, kind, )

/* A part of another table. */
#define WRCD_RANGE_OF(F, what) F(int32_t, first_##what, ) F(int32_t, what, )

/* A multiplexer, and the values with which the frame carries what is behind it. */
#define WRCD_CONDITION(F) WRCD_FIELD(F) WRCD_RANGE_OF(F, numbers)

/* What a sender says of itself: words for well and for degraded; any other word, or none in time, is to be believed
 * nothing. Kept: it comes in other frames than what it is about, and the newest counts until it is too old. */
#define WRCD_STATUS_RULE(F)                                                                        \
    WRCD_FIELD(F) WRCD_RANGE_OF(F, conditions) WRCD_RANGE_OF(F, oks) WRCD_RANGE_OF(F, degradeds)   \
    F(int32_t, is_kept, ) F(int32_t, message, ) F(int64_t, timeout_us, )
#define WRCD_STATUS_STATE(F) F(uint64_t, word, ) F(int64_t, stamp_us, )

/* A mapped signal. physical = raw * scale + offset lies within low ... high, its SI value within +-limit; at an end
 * (first_end, last_end) it is clipped. Words: of a direction, which raw values are reverse; without them its sign says so. */
#define WRCD_INPUT(F)                                                                              \
    F(double, scale, ) F(double, offset, ) F(double, factor, ) F(double, low, ) F(double, high, )  \
    F(double, limit, ) F(double, first_end, ) F(double, last_end, ) F(double, max_step, )          \
    F(double, start, /* value before the first */) F(int64_t, timeout_us, ) F(int64_t, silent_us, )   \
    WRCD_FIELD(F) WRCD_RANGE_OF(F, conditions) WRCD_RANGE_OF(F, unusable) WRCD_RANGE_OF(F, words)  \
    WRCD_RANGE_OF(F, rules) F(int32_t, quantity, ) F(int32_t, axles, /* a bit each */)             \
    F(int32_t, only_words, ) F(int32_t, next, /* of those that add up; -1: none */)
/* All that is known of it. Waiting: measurements on their way to a tick. Reach: a bit for each time-out, the newest
 * lowest; set: a good frame came in it. Refusals: since the newest good frame, each reason in the order of its first. */
#define WRCD_INPUT_STATE(F)                                                                        \
    F(double, value, ) F(int64_t, stamp_us, ) F(int64_t, used_us, ) F(double, waiting, [2])        \
    F(int64_t, waiting_us, [2]) F(int64_t, reach_until_us, ) F(int64_t, rejected_us, )             \
    F(int64_t, refused_since_us, )                                                                 \
    F(double, seen, ) F(double, doubted, ) F(int64_t, seen_us, ) F(double, share, ) F(double, frames, ) \
    F(int64_t, refused, [WRCD_REASONS]) F(int64_t, clipped, ) F(int64_t, run, )                    \
    F(int32_t, waits, ) F(int32_t, surplus_ticks, ) F(int32_t, reach, ) F(int32_t, rejected, )     \
    F(int32_t, is_degraded, ) F(int32_t, is_contested, ) F(int32_t, jumped, ) F(int32_t, refusals, ) \
    F(uint8_t, order, [16])

/* A mapped message: kind, length, E2E, its signals; mask: the bits by which a frame's word must be its own, not all where it
 * is a parameter group (J1939); tells: statuses that it keeps for others. */
#define WRCD_MESSAGE(F)                                                                            \
    F(uint32_t, word, ) F(uint32_t, mask, ) F(int32_t, length, ) F(int32_t, is_fd, ) F(int32_t, is_protected, ) \
    F(int32_t, crc_start, ) F(int32_t, is_multiplexed, ) WRCD_RANGE_OF(F, others)                  \
    WRCD_RANGE_OF(F, signals) WRCD_RANGE_OF(F, tells)
/* The chain of its sender's counters, and a rival's beside it; what was refused. Sender: of a group, the newest frame's source
 * address, -1: none; contested: frames that are still refused, if they all come from it. */
#define WRCD_MESSAGE_STATE(F)                                                                      \
    F(int64_t, last_us, ) F(int64_t, candidate_us, ) F(int64_t, refused, [WRCD_REASONS])           \
    F(int32_t, last, /* counter; -1: none */) F(int32_t, candidate, ) F(int32_t, candidate_frames, ) \
    F(int32_t, frames_since_candidate, ) F(int32_t, moves, ) F(int32_t, quarantine_frames, )       \
    F(int32_t, payload_bytes, ) F(int32_t, sender, ) F(int32_t, contested_frames, ) F(int32_t, reserved, ) \
    F(uint8_t, payload, [64])

/* What a frame may carry, by the names of wrcd/core/vocabulary.py; words by their place there. */
#define WRCD_TOLD(F)                                                                               \
    F(Validity) F(MuAvailable) F(MuUsed) F(SampleAge) F(Surface) F(ContactState) F(Confidence)     \
    F(WinningModel) F(StaleYawRate) F(StaleLatAccel) F(StaleTorque) F(StaleSpeed) F(DominantRule)  \
    F(Residual1) F(Residual2) F(Residual3) F(Residual4) F(Cause)                                   \
    F(Plausibility) F(Outlier) F(Unchanged) F(ReachYawRate) F(ReachLatAccel) F(ReachTorque)        \
    F(ReachSpeed) F(RefusedYawRate) F(RefusedLatAccel) F(RefusedTorque) F(RefusedSpeed)            \
    F(MuAvailableOwn) F(HalfWidthOwn) F(AxlesFused) F(MuUsedMost) F(MuUsedMostAxle)                \
    F(State) F(DesignFit) F(Overruns) F(RejectedFrames) F(LastReason) F(ReceiveDrops) F(Reopens) F(DesignChecksum) \
    F(RejectedKind) F(RejectedLength) F(RejectedCrc) F(RejectedDataId) F(RejectedRepeat)           \
    F(RejectedCounter) F(RejectedTwoSenders) F(RejectedStatus) F(RejectedRange) F(RejectedNotFinite) \
    F(RejectedStuck) F(RejectedJump) F(ForeignFrames)                                              \
    F(LinkState) F(ErrorFrames) F(BusOffs) F(Unsent) F(TimeSteps) F(LateFrames) F(Outliers) F(Restarts)
#define WRCD_TELL(name) WRCD_TOLD_##name,
enum wrcd_told { WRCD_TOLD(WRCD_TELL) WRCD_TOLD_COUNT };
#undef WRCD_TELL
enum { WRCD_MAX_WORDS = 32, WRCD_MAX_SENT_BYTES = 8, WRCD_MAX_SIGNALS = 128 /* mapped, of a message */ };

/* A message that is sent: of an axle, or of the daemon (-1). Start: its bytes before the values are put in. */
enum { WRCD_ADHESION, WRCD_DETAIL, WRCD_INPUTS_SEEN, WRCD_OWN_WORD, WRCD_DAEMON, WRCD_REJECTS };
#define WRCD_SENT(F)                                                                               \
    F(int64_t, cycle_us, ) F(uint32_t, word, ) F(int32_t, axle, ) F(int32_t, kind, ) F(int32_t, length, ) \
    F(int32_t, is_protected, ) F(int32_t, crc_start, ) WRCD_RANGE_OF(F, told)                       \
    F(int32_t, is_last, /* sent when the daemon stops, too */) F(uint8_t, start, [8])
/* A signal of it: what it carries, where it lies, and how a number becomes its raw value; a word's raw value lies ready. */
#define WRCD_TOLD_FIELD(F)                                                                         \
    F(uint64_t, word_raw, [WRCD_MAX_WORDS]) F(double, unit_factor, ) F(double, low, ) F(double, high, ) \
    F(double, scale, ) F(double, offset, ) F(double, lowest, ) F(double, highest, )                \
    F(uint64_t, lowest_raw, ) F(uint64_t, highest_raw, ) F(uint64_t, not_available, ) WRCD_FIELD(F)  \
    F(int32_t, what, ) F(int32_t, is_word, )            \
    F(int32_t, rounds, /* 0 to nearest, -1 down, 1 up */) F(int32_t, is_rounded_down, )

/* What holds for all of it. */
#define WRCD_SETTINGS(F)                                                                           \
    F(int64_t, period_us, ) F(int64_t, input_cycle_us, [WRCD_MAX_AXLES]) F(int64_t, design_checksum, ) \
    F(double, min_speed_m_s, ) F(double, speed_low_m_s, ) F(double, speed_high_m_s, )              \
    F(double, start, [WRCD_QUANTITIES] /* of what no signal gives, or none has given */)            \
    F(double, load_N, ) F(double, radius_m, ) F(double, load_shares, [2]) F(double, radius_shares, [2]) \
    F(double, position_m, [WRCD_MAX_AXLES] /* forward; NaN: not known */) F(int32_t, number, [WRCD_MAX_AXLES])     \
    F(double, surface_pct, [WRCD_MAX_WORDS]) F(double, confidence_pp, [WRCD_MAX_WORDS])            \
    F(int32_t, surfaces, ) F(int32_t, confidences, ) F(int32_t, axles, ) F(int32_t, bogies, ) F(int32_t, messages, ) \
    F(int32_t, inputs, ) F(int32_t, statuses, ) F(int32_t, sent, ) F(int32_t, window_ticks, )      \
    F(int32_t, recent_ticks, ) F(int32_t, torque_is_total, ) F(int32_t, torque_sign_counts, )      \
    F(int32_t, speed_tells_direction, ) F(int32_t, is_placed, /* and speed and direction are known */)                 \
    F(int32_t, partner, [WRCD_MAX_AXLES] /* the other axle of the bogie; -1: none */)             \
    F(int32_t, axles_of, [WRCD_MAX_AXLES] /* two by two those of the bogies that the design is judged in */) \
    F(int32_t, input_of, [WRCD_QUANTITIES][WRCD_MAX_AXLES] /* the first of those that add up; -1: not mapped */)

/* An axle: its Validity, as validity.c counts it, and what was sent of it at the newest slot. */
#define WRCD_AXLE_STANDING(F)                                                                      \
    F(int64_t, outlier_us, ) F(int64_t, traction_us, /* when the torque was traction last */)      \
    F(int64_t, resets_in_a_row, ) F(int64_t, waits_until, /* a tick's number */)                   \
    F(int64_t, stale_ticks, ) F(int64_t, fresh_ticks, ) F(int64_t, sound_ticks, )                  \
    F(double, torque_ratio, ) F(int32_t, is_reset, ) F(int32_t, window_full, )                     \
    F(int32_t, newest, /* cause of the newest tick */) F(int32_t, unsound, /* of the newest that was not sound */) \
    F(int32_t, begun, /* why it began */) F(int32_t, tick_cause, /* against the newest tick, run or not */) \
    F(int32_t, stale, /* a bit for each quantity, of the newest tick */) F(int32_t, has_estimate, ) \
    F(int32_t, standing, /* cause */) F(int32_t, validity, ) F(int32_t, cause, ) F(int32_t, confidence, )

/* The train. Health is what the loop knows and WrcdStatus and WrcdLink send. */
#define WRCD_HEALTH(F)                                                                             \
    F(int64_t, state, ) F(int64_t, overruns, ) F(int64_t, drops, ) F(int64_t, reopens, ) F(int64_t, link_state, ) \
    F(int64_t, error_frames, ) F(int64_t, bus_offs, ) F(int64_t, unsent, ) F(int64_t, foreign_frames, )
#define WRCD_CORE_STATE(F)                                                                         \
    WRCD_HEALTH(F)                                                                                 \
    F(int64_t, open, /* number of the tick that gathers frames */) F(int64_t, begin_us, ) F(int64_t, end_us, ) \
    F(int64_t, stamp_us, /* newest */) F(int64_t, accepted, ) F(int64_t, refused, ) F(int64_t, late, ) F(int64_t, time_steps, ) \
    F(int64_t, restarts, ) F(int64_t, ticks, ) F(int64_t, waits, ) F(int64_t, last_reason, )       \
    F(int64_t, told_refused, [WRCD_REASONS] /* at the newest WrcdRejects */) F(int64_t, told_foreign, ) \
    F(int32_t, is_open, ) F(int32_t, speed_jumped, ) F(int32_t, is_reverse, ) F(int32_t, is_muted, ) \
    F(int32_t, keeps_samples, ) F(int32_t, keeps_ticks, ) F(int32_t, were_reset, /* axles since the newest tick */) \
    F(int32_t, reserved, )

/* Whether the design is this train's (fit.c). The table: the design's bogie and what is known before; constants, unknowns and
 * bins are wrcd/fit's. */
enum {
    WRCD_BOGIE_CONSTANTS = 23, WRCD_FIT_UNKNOWNS = 29, WRCD_FIT_SIGNALS = 4, WRCD_FIT_BINS = 26, WRCD_FIT_TICKS = 1024,
    WRCD_FIT_RING = 128 /* ticks that a wheelbase may take */
};
enum wrcd_fit_verdict { WRCD_FIT_UNKNOWN, WRCD_FIT_LIKE, WRCD_FIT_UNSURE, WRCD_FIT_UNLIKE };
#define WRCD_FIT_TABLE(F)                                                                          \
    F(double, tick_s, ) F(double, constants, [WRCD_BOGIE_CONSTANTS]) F(double, own_sigma, [WRCD_FIT_UNKNOWNS])         \
    F(double, free_sigma, [WRCD_FIT_UNKNOWNS]) F(double, bias, [WRCD_FIT_UNKNOWNS] /* percentage points */) \
    F(double, noise, [WRCD_FIT_SIGNALS]) F(double, incoherence, ) F(double, secant_N, ) F(double, block_sigma, [3]) \
    F(double, power_sigma, ) F(double, basis, [3 * WRCD_FIT_BINS]) F(double, cosine, [WRCD_FIT_TICKS]) \
    F(double, highpass, [12]) F(double, wheelbase_m, ) F(double, least_speed_m_s, ) F(double, steady, ) \
    F(double, alike, ) F(double, straight_1_m, ) F(double, pulse_sigma, ) F(double, most_missing, ) F(double, most_stretches, ) \
    F(int32_t, ticks, /* of a stretch; 0: nothing is known of a bogie */) F(int32_t, first_bin, ) F(int32_t, bins_apart, ) \
    F(int32_t, reserved, )
/* Of a bogie. Its verdict; then, which begins anew where the train turns round, the two stretches that are gathered, half a
 * stretch apart, the block that they make, the block that is looked at, and the sum of all. */
#define WRCD_BOGIE_STATE(F)                                                                        \
    F(double, ratio, ) F(double, bias_pp, ) F(double, bias_sigma_pp, ) F(double, incoherence, /* of the own */) F(double, free, [WRCD_FIT_UNKNOWNS] /* of any vehicle */) \
    F(int32_t, verdict, ) F(int32_t, is_reverse, )                                                 \
    F(int64_t, ticks, ) F(int64_t, newest_tick, ) F(double, ring, [WRCD_FIT_RING][WRCD_FIT_SIGNALS]) \
    F(double, newest, [WRCD_FIT_SIGNALS]) F(double, highpass, [8]) F(double, zero, [2]) F(double, zeros, ) \
    F(double, sum, [2][WRCD_FIT_BINS][2][WRCD_FIT_SIGNALS]) F(double, turning, [2][4][2]) F(double, high, [2][2][2]) \
    F(double, speed, [2]) F(double, slowest, [2]) F(double, fastest, [2]) F(int32_t, missing, [2][WRCD_FIT_SIGNALS]) \
    F(int32_t, delay, [2]) F(int32_t, is_spoiled, [2])                                             \
    F(double, block, [WRCD_FIT_BINS][16]) F(double, block_m_s, ) F(double, block_first_m_s, ) F(int64_t, block_stretches, ) \
    F(double, cross, [WRCD_FIT_BINS][16]) F(double, of_speed_m_s, ) F(double, of_stretches, )      \
    F(double, powers, [WRCD_FIT_BINS][2]) F(double, expected, [WRCD_FIT_BINS][2]) F(double, of_block, [3]) \
    F(double, best_of_block, [3]) F(double, step, [3]) F(double, best, ) F(double, objective, ) F(double, misfit, ) \
    F(double, gradient, [WRCD_FIT_UNKNOWNS + 3]) F(double, fisher, [WRCD_FIT_UNKNOWNS + 3][WRCD_FIT_UNKNOWNS + 3]) \
    F(int32_t, pass, /* 0: none is looked at */) F(int32_t, bin, ) F(int32_t, again, ) F(int32_t, is_of_another, ) \
    F(double, at, [WRCD_FIT_UNKNOWNS] /* that it is looked at with */) F(double, incoherent, [2] /* logs, of looks at the own and another one */) \
    F(double, looks, [2]) F(double, of_another, /* log, of the block */) \
    F(double, information, [WRCD_FIT_UNKNOWNS][WRCD_FIT_UNKNOWNS]) F(double, score, [WRCD_FIT_UNKNOWNS]) \
    F(double, unknowns, [WRCD_FIT_UNKNOWNS] /* of a vehicle like the design's */) F(double, weight, /* stretches */)

/* A frame that was made: of the slot that begins at its stamp; report: its axle's place among the reports, -1: none. */
#define WRCD_MADE(F)                                                                               \
    F(int64_t, stamp_us, ) F(uint32_t, word, ) F(uint8_t, length, ) F(uint8_t, flags, ) F(uint16_t, cause, ) \
    F(uint8_t, data, [8]) F(int64_t, cycle_us, ) F(int32_t, report, ) F(int32_t, axle, )

/* An axle at a slot; NaN is not available. estimate: what it was made from, where there is one. */
#define WRCD_REPORT(F)                                                                             \
    F(int64_t, time_us, ) F(double, mu_available_pct, ) F(double, mu_used_pct, ) F(double, own_pct, )  \
    F(double, own_half_width_pp, ) F(double, most_used_pct, ) F(int32_t, most_used_axle, ) F(int32_t, axles, )      \
    F(int32_t, axle, ) \
    F(int32_t, validity, ) F(int32_t, cause, ) F(int32_t, sample_age_ms, ) F(int32_t, surface, )   \
    F(int32_t, contact, ) F(int32_t, confidence, ) F(int32_t, is_short, ) F(int32_t, has_estimate, ) F(int32_t, reserved, )

/* Something that happened to an axle. DETAIL: how a cause is as it begins; CHANGE: of its Validity or the cause, with the
 * figures of that, or those of the newest DETAIL of the cause. Inputs that are concerned: two, of `listed`, each with its
 * age (NEVER: it has not come) and what was refused since. */
enum { WRCD_DETAIL_EVENT = 1, WRCD_CHANGE_EVENT };
enum { WRCD_OWN_FIGURES, WRCD_KNOWN_FIGURES, WRCD_ESTIMATE_FIGURES }; /* of a change */
#define WRCD_EVENT(F)                                                                              \
    F(int64_t, time_us, ) F(double, number, [8]) F(int64_t, age_us, [2]) F(int64_t, refused, [2][WRCD_REASONS]) \
    F(int32_t, kind, ) F(int32_t, axle, ) F(int32_t, cause, ) F(int32_t, before, ) F(int32_t, after, ) \
    F(int32_t, figures, ) F(int32_t, is_over, /* nothing speaks against the ticks any more */) F(int32_t, listed, ) F(int32_t, input, [2]) F(int32_t, refusals, [2])    \
    F(uint8_t, order, [2][16])

/* A value of an accepted frame, and a tick that the estimator took, for who wants to see them. */
#define WRCD_SAMPLE(F)                                                                             \
    F(int64_t, stamp_us, ) F(double, value, ) F(int32_t, input, ) F(int32_t, frame, /* of those given at once */) \
    F(int32_t, is_degraded, ) F(int32_t, is_contested, )
#define WRCD_TICK_SEEN(F)                                                                          \
    F(int64_t, number, ) F(double, speed_m_s, ) F(double, z, [WRCD_CHANNELS][WRCD_MAX_AXLES])      \
    F(double, torque_ratio, [WRCD_MAX_AXLES]) F(int32_t, were_reset, /* axles before it, a bit each */)         \
    F(int32_t, reserved, ) F(uint8_t, present, [WRCD_CHANNELS][WRCD_MAX_AXLES])

#define WRCD_DECLARE(type, name, dimensions) type name dimensions;
typedef struct { WRCD_FIELD(WRCD_DECLARE) } wrcd_field;
typedef struct { WRCD_CONDITION(WRCD_DECLARE) } wrcd_condition;
typedef struct { WRCD_STATUS_RULE(WRCD_DECLARE) } wrcd_status_rule;
typedef struct { WRCD_STATUS_STATE(WRCD_DECLARE) } wrcd_status_state;
typedef struct { WRCD_INPUT(WRCD_DECLARE) } wrcd_input;
typedef struct { WRCD_INPUT_STATE(WRCD_DECLARE) } wrcd_input_state;
typedef struct { WRCD_MESSAGE(WRCD_DECLARE) } wrcd_message;
typedef struct { WRCD_MESSAGE_STATE(WRCD_DECLARE) } wrcd_message_state;
typedef struct { WRCD_SENT(WRCD_DECLARE) } wrcd_sent;
typedef struct { WRCD_TOLD_FIELD(WRCD_DECLARE) } wrcd_told_field;
typedef struct { WRCD_SETTINGS(WRCD_DECLARE) } wrcd_settings;
typedef struct { WRCD_AXLE_STANDING(WRCD_DECLARE) } wrcd_axle_state;
typedef struct { WRCD_CORE_STATE(WRCD_DECLARE) } wrcd_core_state;
typedef struct { WRCD_FIT_TABLE(WRCD_DECLARE) } wrcd_fit_table;
typedef struct { WRCD_BOGIE_STATE(WRCD_DECLARE) } wrcd_bogie_state;
typedef struct { WRCD_MADE(WRCD_DECLARE) } wrcd_made;
typedef struct { WRCD_REPORT(WRCD_DECLARE) wrcd_adhesion estimate; } wrcd_report;
typedef struct { WRCD_EVENT(WRCD_DECLARE) } wrcd_event;
typedef struct { WRCD_SAMPLE(WRCD_DECLARE) } wrcd_sample;
typedef struct { WRCD_TICK_SEEN(WRCD_DECLARE) wrcd_result result; } wrcd_tick_seen;
#undef WRCD_DECLARE

/* Tables and state. Ranges of `conditions`, `numbers`, `words`, `rules` and so on are of these arrays. */
typedef struct {
    const wrcd_settings *settings;
    const wrcd_message *message; /* sorted by word */
    const wrcd_input *input;     /* of one message behind the other */
    const wrcd_status_rule *status;
    const wrcd_condition *condition;
    const int64_t *number;       /* of multiplexers, unusable raw values, words of statuses, starts of other CRCs */
    const int64_t *word;         /* two each: raw value, whether it is reverse */
    const int32_t *rule;         /* statuses of inputs, and those of other messages */
    const wrcd_sent *sent;       /* of a kind by axles: adhesion, detail, inputs, own words; then the daemon's */
    const wrcd_told_field *told;
    const wrcd_fit_table *fit;
    const wrcd_design *design;
    wrcd_core_state *core;
    wrcd_message_state *message_state;
    wrcd_input_state *input_state;
    wrcd_status_state *status_state;
    wrcd_axle_state *axle;
    wrcd_bogie_state *bogie;
    wrcd_estimator *estimator;
    wrcd_result *result; /* of the newest tick */
} wrcd_train;

/* What has come of frames and time since these were emptied: `counts`, and room for `most`. */
enum { WRCD_OUT_MADE, WRCD_OUT_REPORTS, WRCD_OUT_EVENTS, WRCD_OUT_SAMPLES, WRCD_OUT_TICKS, WRCD_OUT_KINDS };
typedef struct {
    int64_t counts[WRCD_OUT_KINDS], most[WRCD_OUT_KINDS];
    wrcd_made *made;
    wrcd_report *report;
    wrcd_event *event;
    wrcd_sample *sample;
    wrcd_tick_seen *tick;
} wrcd_out;

/* Nothing has come yet, whatever lay in the state. */
void wrcd_core_begin(const wrcd_train *t);
/* Take frames from `first` on, records of `stride` bytes at a multiple of 8: a wrcd_frame's with as many bytes of data as there
 * is room for. Ticks that end before a frame's stamp are closed, as by wrcd_advance(). Returns `frames` where all were taken,
 * else the first that was not, for which there may be no room: empty `out` and go on from there. */
int64_t wrcd_feed(const wrcd_train *t, wrcd_out *out, const unsigned char *records, int64_t stride, int64_t first, int64_t frames);
/* Every frame stamped before now_us has been fed: close the ticks that end by then. Returns 0 where there is no room: empty `out`
 * and call it again. */
int wrcd_advance(const wrcd_train *t, wrcd_out *out, int64_t now_us);
/* The last frames: every axle NotAvailable, the daemon stopping. Returns as wrcd_advance(). */
int wrcd_shutdown(const wrcd_train *t, wrcd_out *out, int64_t now_us);
/* The first end of a tick not closed yet with which frames are due; NEVER before the first frame. */
int64_t wrcd_next_slot_us(const wrcd_train *t);

#ifdef __cplusplus
}
#endif
#endif
