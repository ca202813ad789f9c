/* What a slot's frames tell while every axle's state is as before, and the frames. As slot.py, messages.py and
 * bus/writers.py. */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lane.h"

enum { VALID = 1, DEGRADED, QUANTITIES_TOLD = 4 };
enum { ADHERING = 1, SATURATED, CONSISTENT = 1, FULL, CONTRADICTS };

/* Age of the oldest of gyro, acceleration, torques and speed, in ms. */
static double age_ms(const wrcd_lane *k, const wrcd_lane_place *place, int axle, int64_t end_us)
{
    int64_t oldest = INT64_MAX;

    for (int q = 0; q <= BRAKE; q++) {
        const wrcd_lane_place *p = &place[q * k->axles + axle];
        const int64_t came_us = q < TORQUE ? p->used_us : p->stamp_us;
        if (p->is_mapped && came_us < oldest)
            oldest = came_us;
    }
    const int64_t age = (end_us - oldest) / 1000;
    return age < 255 ? (double)age : 255.0;
}

static int level_of(const wrcd_lane *k, double half_width_pp)
{
    int level = 0;

    while (level < k->confidences - 1 && half_width_pp > k->confidence_pp[level])
        level++;
    return level + 1; /* behind None */
}

/* The narrowest level that holds a half-width. To a narrower one than before it goes only where there is room. */
static int confidence_of(const wrcd_lane *k, double half_width_pp, int before)
{
    const int level = level_of(k, half_width_pp), roomy = level_of(k, half_width_pp / k->room);

    return before == 0 || level >= before ? level : roomy < before ? roomy : before;
}

static double number(double x) { return isfinite(x) ? x : NAN; }

static int cause_of(const wrcd_lane *k, int standing, const wrcd_adhesion *a)
{
    if (standing != 0 || a->doubt != (double)WRCD_NO_DOUBT)
        return standing != 0 ? standing : k->of_doubt[(int)a->doubt];
    return !isfinite(a->mu_available_pct) ? k->too_little_data : a->contradicted > 0.0 ? k->contradiction : 0;
}

/* What is told of an axle, explained where such a frame is due; false where its state is another one than in the slot
 * before. */
static bool tell_of(const wrcd_lane *k, wrcd_lane_place *place, int axle, int64_t end_us, const wrcd_adhesion *a,
                    bool explained, double told[WRCD_TOLD_COUNT])
{
    const int cause = cause_of(k, k->standing[axle], a);
    const bool valid = cause == 0, known = isfinite(a->mu_available_pct);
    const double mu = number(a->mu_available_pct), used = fmin(100.0 * k->torque_ratio[axle], 100.0);
    int surface = 0;

    if (cause != k->cause[axle] || isnan(k->torque_ratio[axle]) || (valid && !isfinite(a->half_width_pp)))
        return false;
    while (surface < k->surfaces - 1 && mu < k->surface_pct[surface])
        surface++;
    told[WRCD_VALIDITY] = valid ? VALID : DEGRADED;
    told[WRCD_MU_AVAILABLE] = mu;
    told[WRCD_MU_USED] = valid ? fmin(used, mu) : used;
    told[WRCD_SAMPLE_AGE] = age_ms(k, place, axle, end_us);
    told[WRCD_SURFACE] = known ? surface + 1 : 0; /* Unknown is first */
    told[WRCD_CONTACT_STATE] = !known ? 0 : a->saturated > 0.0 ? SATURATED : ADHERING;
    told[WRCD_CONFIDENCE] = valid ? confidence_of(k, a->half_width_pp, k->confidence[axle]) : 0;
    told[WRCD_WINNING_MODEL] = a->winner;
    told[WRCD_DOMINANT_RULE] = a->rule;
    for (int m = 0; m < WRCD_MODELS; m++)
        told[WRCD_RESIDUAL_1 + m] = isfinite(a->residuals[m]) ? 20.0 * log10(a->residuals[m]) : NAN;
    told[WRCD_CAUSE] = cause;
    told[WRCD_PLAUSIBILITY] = !known ? 0 : a->contradicted > 0.0 ? CONTRADICTS : a->saturated > 0.0 ? FULL : CONSISTENT;
    told[WRCD_OUTLIER] = end_us - k->outlier_us[axle] <= k->inputs_cycle_us[axle];
    told[WRCD_UNCHANGED] = 0.0;
    for (int q = 0; q < QUANTITIES_TOLD; q++) {
        told[WRCD_STALE_YAW_RATE + q] = told[WRCD_REFUSED_YAW_RATE + q] = 0.0;
        told[WRCD_REACH_YAW_RATE + q] = explained ? wrcd_lane_reach(&place[q * k->axles + axle], end_us) : 0.0;
    }
    return true;
}

static uint64_t bits_of(const wrcd_lane_field *f, double value)
{
    int64_t raw = f->not_available;

    if (f->is_word)
        return f->word_bits[(int)value];
    if (isfinite(value)) {
        value *= f->factor;
        if (value < f->low && f->is_rounded_down && f->low > 0.0)
            return ((uint64_t)raw & f->mask) << f->shift;
        value = value < f->low ? f->low : value > f->high ? f->high : value;
        const double steps = (value - f->offset) / f->scale;
        const double whole = f->rounds < 0 ? floor(steps) : f->rounds > 0 ? ceil(steps) : rint(steps);
        raw = whole < (double)f->lowest ? f->lowest : whole > (double)f->highest ? f->highest : (int64_t)whole;
    }
    return ((uint64_t)raw & f->mask) << f->shift;
}

static void pack(const wrcd_lane_sent *s, const wrcd_lane_field *field, const uint8_t *crc_table, int64_t end_us,
                 const double told[WRCD_TOLD_COUNT], wrcd_frame *out)
{
    uint64_t whole = s->start;

    for (int i = s->first_field; i < s->first_field + s->fields; i++)
        whole = (whole & ~(field[i].mask << field[i].shift)) | bits_of(&field[i], told[field[i].told]);
    memset(out, 0, sizeof *out);
    out->stamp_us = end_us;
    out->word = s->word;
    out->length = (uint8_t)s->length;
    for (int k = 0; k < s->length && k < (int)sizeof out->data; k++)
        out->data[s->is_big_endian ? s->length - 1 - k : k] = (uint8_t)(whole >> 8 * k);
    if (s->is_protected) {
        uint8_t crc = (uint8_t)s->crc_start;
        out->data[1] = (uint8_t)((out->data[1] & 0xF0) | (end_us / s->cycle_us % COUNTER_MODULO));
        for (int k = 1; k < s->length; k++)
            crc = crc_table[crc ^ out->data[k]];
        out->data[0] = crc;
    }
}

int wrcd_lane_tell(wrcd_lane *k, const wrcd_lane_tables *t, const wrcd_estimator *e, const wrcd_design *d)
{
    wrcd_adhesion adhesion[WRCD_MAX_AXLES];
    double told[WRCD_MAX_AXLES][WRCD_TOLD_COUNT];
    const int64_t end_us = k->begin_us;

    if (k->out_frames + k->sent > t->max_made || k->out_slots >= t->max_slots || end_us <= k->rejected_until_us)
        return false;
    for (int axle = 0; axle < k->axles; axle++)
        if (k->sound_ticks[axle] < k->window_ticks || k->of_pair[wrcd_pair_state(e, axle)] != k->standing[axle])
            return false;
    bool explained = false;
    for (int i = k->adhesions; i < k->sent; i++)
        explained = explained || end_us % t->sent[i].cycle_us < k->period_us;
    wrcd_estimate(e, d, adhesion);
    for (int axle = 0; axle < k->axles; axle++)
        if (!tell_of(k, t->place, axle, end_us, &adhesion[axle], explained, told[axle]))
            return false;
    wrcd_lane_slot *slot = &t->slot[k->out_slots];
    slot->end_us = end_us;
    for (int axle = 0; axle < k->axles; axle++) {
        memcpy(slot->told[axle], told[axle], WRCD_CAUSE_OF * sizeof(double));
        slot->told[axle][WRCD_CAUSE_OF] = told[axle][WRCD_CAUSE];
        slot->told[axle][WRCD_IS_SHORT] = k->cause[axle] == k->too_little_data && adhesion[axle].doubt != (double)WRCD_GAPS;
        k->confidence[axle] = (int32_t)told[axle][WRCD_CONFIDENCE];
    }
    k->out_slots++;
    for (int i = 0; i < k->sent; i++)
        if (end_us % t->sent[i].cycle_us < k->period_us) {
            wrcd_frame *made = &t->made[k->out_frames++];
            pack(&t->sent[i], t->field, t->crc_table, end_us, told[t->sent[i].axle], made);
            made->cause = (uint16_t)(i < k->adhesions ? k->cause[t->sent[i].axle] : 0);
        }
    return true;
}
