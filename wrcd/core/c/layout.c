/* Where what lies in the core's records, for who reads them from another language. */
#include "core.h"

typedef struct { const char *name, *type; size_t offset, bytes; } field;

#define AT(of, name, dimensions) {#name, #of, offsetof(RECORD, name), sizeof ((const RECORD *)0)->name},
#define END {NULL, NULL, sizeof(RECORD), 0}
#define RECORD wrcd_settings
static const field SETTINGS[] = {WRCD_SETTINGS(AT) END};
#undef RECORD
#define RECORD wrcd_message
static const field MESSAGE[] = {WRCD_MESSAGE(AT) END};
#undef RECORD
#define RECORD wrcd_input
static const field INPUT[] = {WRCD_INPUT(AT) END};
#undef RECORD
#define RECORD wrcd_status_rule
static const field STATUS[] = {WRCD_STATUS_RULE(AT) END};
#undef RECORD
#define RECORD wrcd_condition
static const field CONDITION[] = {WRCD_CONDITION(AT) END};
#undef RECORD
#define RECORD wrcd_sent
static const field SENT[] = {WRCD_SENT(AT) END};
#undef RECORD
#define RECORD wrcd_told_field
static const field TOLD[] = {WRCD_TOLD_FIELD(AT) END};
#undef RECORD
#define RECORD wrcd_core_state
static const field CORE[] = {WRCD_CORE_STATE(AT) END};
#undef RECORD
#define RECORD wrcd_message_state
static const field MESSAGE_STATE[] = {WRCD_MESSAGE_STATE(AT) END};
#undef RECORD
#define RECORD wrcd_input_state
static const field INPUT_STATE[] = {WRCD_INPUT_STATE(AT) END};
#undef RECORD
#define RECORD wrcd_status_state
static const field STATUS_STATE[] = {WRCD_STATUS_STATE(AT) END};
#undef RECORD
#define RECORD wrcd_axle_state
static const field AXLE[] = {WRCD_AXLE_STANDING(AT) END};
#undef RECORD
#define RECORD wrcd_fit_table
static const field FIT[] = {WRCD_FIT_TABLE(AT) END};
#undef RECORD
#define RECORD wrcd_bogie_state
static const field BOGIE_STATE[] = {WRCD_BOGIE_STATE(AT) END};
#undef RECORD
#define RECORD wrcd_made
static const field MADE[] = {WRCD_MADE(AT) END};
#undef RECORD
#define RECORD wrcd_adhesion
#define AT_DOUBLE(name, dimensions) AT(double, name, dimensions)
static const field ESTIMATE[] = {WRCD_ESTIMATE(AT_DOUBLE) END};
#undef RECORD
#define RECORD wrcd_axle
static const field ESTIMATOR_AXLE[] = {WRCD_AXLE_STATE(AT_DOUBLE) END};
#undef RECORD
#define RECORD wrcd_estimator
static const field ESTIMATOR[] = {WRCD_TRAIN_STATE(AT_DOUBLE) AT(estimator_axle, axle, ) END};
#undef RECORD
#define RECORD wrcd_report
static const field REPORT[] = {WRCD_REPORT(AT) AT(estimate, estimate, ) END};
#undef RECORD
#define RECORD wrcd_event
static const field EVENT[] = {WRCD_EVENT(AT) END};
#undef RECORD
#define RECORD wrcd_sample
static const field SAMPLE[] = {WRCD_SAMPLE(AT) END};
#undef RECORD
#define RECORD wrcd_result
static const field RESULT[] = {
    AT(double, innovations, ) AT(double, whitened, ) AT(uint8_t, accepted, ) AT(uint8_t, outliers, )
    AT(uint8_t, near_pulse, ) AT(uint8_t, live, ) AT(uint8_t, calm, ) AT(uint8_t, needs_reset, ) END};
#undef RECORD
#define RECORD wrcd_tick_seen
static const field TICK[] = {WRCD_TICK_SEEN(AT) AT(result, result, ) END};

static const struct { const char *name; const field *fields; } RECORDS[] = {
    {"settings", SETTINGS}, {"message", MESSAGE}, {"input", INPUT}, {"status", STATUS}, {"condition", CONDITION},
    {"sent", SENT}, {"told", TOLD}, {"core", CORE}, {"message_state", MESSAGE_STATE}, {"input_state", INPUT_STATE},
    {"status_state", STATUS_STATE}, {"axle", AXLE}, {"fit", FIT}, {"bogie_state", BOGIE_STATE}, {"estimator_axle", ESTIMATOR_AXLE},
    {"estimator", ESTIMATOR}, {"estimate", ESTIMATE}, {"result", RESULT}, {"made", MADE},
    {"report", REPORT}, {"event", EVENT}, {"sample", SAMPLE}, {"tick", TICK},
};

#define NAME(name) #name,
static const char *const TELLS[] = {WRCD_TOLD(NAME)};

/* The n-th record's name; NULL behind the last. */
const char *wrcd_record_name(int n) { return n < (int)(sizeof RECORDS / sizeof *RECORDS) ? RECORDS[n].name : NULL; }
/* Its fields; behind the last one without a name, the offset of which is the record's size. */
const field *wrcd_record_fields(int n) { return RECORDS[n].fields; }
/* The n-th of what a frame may carry; NULL behind the last. */
const char *wrcd_told_name(int n) { return n < WRCD_TOLD_COUNT ? TELLS[n] : NULL; }
