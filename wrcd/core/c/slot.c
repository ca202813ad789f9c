/* What a slot's frames carry, and the frames. Words are sent by their place in wrcd/core/vocabulary.py. */
#include "core.h"

enum { ADHERING = 1, SATURATED, CONSISTENT = 1, FULL, CONTRADICTS, OLDEST_MS = 255, MOST_OF_A_REASON = 15 };
static const double UNLIKE_TIMES = 1.5, UNLIKE_SIGMAS = 1.645;
static const double ROOM = 0.9; /* of a level's half-width */
static const int TOLD_OF[4] = {WRCD_YAW, WRCD_LAT, WRCD_TORQUE, WRCD_SPEED};

static bool is_slot(const wrcd_train *t, int64_t cycle_us, int64_t end_us)
{
    return remainder_of(end_us, cycle_us) < t->settings->period_us;
}

static int level_of(const wrcd_settings *s, double half_width_pp)
{
    int level = 0;

    while (level < s->confidences - 1 && half_width_pp > s->confidence_pp[level])
        level++;
    return level + 1; /* behind None */
}

/* The narrowest level that holds a half-width. From the level before to a narrower one it goes only where there is room, or
 * it would go up and down with every frame. */
static int confidence_of(const wrcd_settings *s, double half_width_pp, int before)
{
    const int level = level_of(s, half_width_pp), roomy = level_of(s, half_width_pp / ROOM);

    if (!isfinite(half_width_pp))
        return 0;
    return before == 0 || level >= before ? level : roomy < before ? roomy : before;
}

static double finite_or_nan(double x) { return isfinite(x) ? x : NAN; }

/* An axle at a slot. a: its estimate, NULL without one; own: what it says alone. */
static void report_of(const wrcd_train *t, int axle, int64_t end_us, const wrcd_adhesion *a, const axle_words *own, wrcd_report *r)
{
    const wrcd_axle_state *state = &t->axle[axle];
    const wrcd_settings *s = t->settings;
    const double used = 100.0 * state->torque_ratio;
    int surface = 0;

    memset(r, 0, offsetof(wrcd_report, estimate));
    r->time_us = end_us;
    r->axle = axle;
    r->sample_age_ms = wrcd_age_ms(t, axle, end_us);
    r->validity = wrcd_verdict(state->standing, a, &r->cause);
    r->mu_available_pct = r->own_pct = r->own_half_width_pp = r->most_used_pct = NAN;
    r->mu_used_pct = isnan(used) ? NAN : fmin(used, 100.0);
    if (a == NULL)
        return;
    const double mu = finite_or_nan(a->mu_available_pct);
    const bool is_known = !isnan(mu), is_sure = is_known && r->validity == WRCD_VALID;
    r->has_estimate = 1;
    r->estimate = *a;
    r->own_pct = finite_or_nan(own->pct);
    r->own_half_width_pp = finite_or_nan(own->half_width_pp);
    r->most_used_pct = own->most_used_pct;
    r->most_used_axle = isnan(own->most_used_pct) ? 0 : own->most_used_axle;
    r->axles = own->axles;
    r->mu_available_pct = mu;
    if (is_sure) /* what the newest torque is beyond the newest part's mean turns the wheel, or is its sensor's noise */
        r->mu_used_pct = isnan(r->mu_used_pct) ? NAN : fmin(r->mu_used_pct, mu);
    while (surface < s->surfaces - 1 && mu < s->surface_pct[surface])
        surface++;
    r->surface = is_known ? surface + 1 : 0; /* behind Unknown */
    r->contact = !is_known ? 0 : a->saturated > 0.0 ? SATURATED : ADHERING;
    r->confidence = is_sure ? confidence_of(s, a->half_width_pp, state->confidence) : 0;
    r->is_short = r->cause == WRCD_CAUSE_TOO_LITTLE_DATA && (int)a->doubt != WRCD_GAPS;
}

static void tell_adhesion(const wrcd_report *r, double told[WRCD_TOLD_COUNT])
{
    told[WRCD_TOLD_Validity] = r->validity;
    told[WRCD_TOLD_MuAvailable] = r->mu_available_pct;
    told[WRCD_TOLD_MuUsed] = r->mu_used_pct;
    told[WRCD_TOLD_SampleAge] = r->sample_age_ms;
    told[WRCD_TOLD_Surface] = r->surface;
    told[WRCD_TOLD_ContactState] = r->contact;
    told[WRCD_TOLD_Confidence] = r->confidence;
}

static void tell_own(const wrcd_report *r, double told[WRCD_TOLD_COUNT])
{
    told[WRCD_TOLD_MuAvailableOwn] = r->own_pct;
    told[WRCD_TOLD_HalfWidthOwn] = r->own_half_width_pp;
    told[WRCD_TOLD_AxlesFused] = r->axles;
    told[WRCD_TOLD_MuUsedMost] = r->most_used_pct;
    told[WRCD_TOLD_MuUsedMostAxle] = r->most_used_axle;
}

/* Why an axle's adhesion is what it is; without an estimate only the cause and which inputs are stale. More in use than
 * available is saturation, or something is wrong. */
static void tell_detail(const wrcd_train *t, const wrcd_report *r, double told[WRCD_TOLD_COUNT])
{
    const wrcd_adhesion *a = &r->estimate;
    const bool is_known = r->has_estimate && isfinite(a->mu_available_pct);

    told[WRCD_TOLD_Cause] = r->cause;
    told[WRCD_TOLD_WinningModel] = r->has_estimate ? a->winner : 0.0;
    told[WRCD_TOLD_DominantRule] = r->has_estimate ? a->rule : NAN;
    for (int k = 0; k < WRCD_MODELS; k++)
        told[WRCD_TOLD_Residual1 + k] = r->has_estimate ? 20.0 * log10(finite_or_nan(a->residuals[k])) : NAN;
    for (int k = 0; k < 4; k++)
        told[WRCD_TOLD_StaleYawRate + k] = t->axle[r->axle].stale >> TOLD_OF[k] & 1;
    told[WRCD_TOLD_Plausibility] = !is_known ? 0 : a->contradicted > 0.0 ? CONTRADICTS : a->saturated > 0.0 ? FULL : CONSISTENT;
}

/* What came of its inputs. */
static void tell_inputs(const wrcd_train *t, const wrcd_report *r, double told[WRCD_TOLD_COUNT])
{
    const int64_t since_us = r->time_us - t->axle[r->axle].outlier_us;

    told[WRCD_TOLD_Outlier] = since_us <= t->settings->input_cycle_us[r->axle];
    told[WRCD_TOLD_Unchanged] = wrcd_any_unchanged(t, r->axle, r->time_us);
    for (int k = 0; k < 4; k++) {
        int refused;
        told[WRCD_TOLD_ReachYawRate + k] = wrcd_reached(t, TOLD_OF[k], r->axle, r->time_us, &refused);
        told[WRCD_TOLD_RefusedYawRate + k] = refused;
    }
}

/* The rules are another bogie's: the interval reaches as far as they are off there, and is no surer than that. */
static void widen(const wrcd_train *t, wrcd_adhesion adhesion[WRCD_MAX_AXLES])
{
    for (int i = 0; i < 2 * t->settings->bogies; i++) {
        const wrcd_bogie_state *b = &t->bogie[i / 2];
        const int axle = t->settings->axles_of[i];
        wrcd_adhesion *a = &adhesion[axle];
        const double own = a->half_width_pp - wrcd_slides_pp(t->estimator, a); /* slides may show the same bias */
        if (b->verdict == WRCD_FIT_UNLIKE)
            a->half_width_pp = fmax(a->half_width_pp, UNLIKE_TIMES * own + fabs(b->bias_pp) + UNLIKE_SIGMAS * b->bias_sigma_pp);
    }
}

/* Of all bogies the worst; Unknown, as long as one is, is no worse than Like. */
static int design_fit(const wrcd_train *t)
{
    int worst = WRCD_FIT_UNKNOWN;

    for (int k = 0; k < t->settings->bogies; k++)
        worst = t->bogie[k].verdict > worst ? t->bogie[k].verdict : worst;
    return worst;
}

static int64_t refused_by(const wrcd_train *t, int reason)
{
    int64_t count = 0;

    for (int k = 0; k < t->settings->messages; k++)
        count += t->message_state[k].refused[reason];
    return count;
}

/* How the daemon and its link are. */
static void tell_daemon(const wrcd_train *t, double told[WRCD_TOLD_COUNT])
{
    const wrcd_core_state *c = t->core;

    told[WRCD_TOLD_State] = (double)c->state;
    told[WRCD_TOLD_DesignFit] = design_fit(t);
    told[WRCD_TOLD_Overruns] = (double)(c->overruns % 256);
    told[WRCD_TOLD_RejectedFrames] = (double)(c->refused % 1024);
    told[WRCD_TOLD_LastReason] = (double)c->last_reason;
    told[WRCD_TOLD_ReceiveDrops] = (double)(c->drops % 64);
    told[WRCD_TOLD_Reopens] = (double)(c->reopens % 16);
    told[WRCD_TOLD_DesignChecksum] = (double)t->settings->design_checksum;
    told[WRCD_TOLD_LinkState] = (double)c->link_state;
    told[WRCD_TOLD_ErrorFrames] = (double)(c->error_frames % 4096);
    told[WRCD_TOLD_BusOffs] = (double)(c->bus_offs % 16);
    told[WRCD_TOLD_Unsent] = (double)(c->unsent % 256);
    told[WRCD_TOLD_TimeSteps] = (double)(c->time_steps % 16);
    told[WRCD_TOLD_LateFrames] = (double)(c->late % 16);
    told[WRCD_TOLD_Outliers] = (double)((int64_t)t->estimator->outliers % 256);
    told[WRCD_TOLD_Restarts] = (double)(c->restarts % 256);
}

/* Of the rejections since the last, and of the daemon's own messages that somebody else sent. */
static void tell_rejects(const wrcd_train *t, double told[WRCD_TOLD_COUNT])
{
    wrcd_core_state *c = t->core;
    const int64_t foreign = c->foreign_frames - c->told_foreign;

    for (int reason = WRCD_REASON_KIND; reason < WRCD_REASONS; reason++) {
        const int64_t refused = refused_by(t, reason), new_ones = refused - c->told_refused[reason];
        told[WRCD_TOLD_RejectedKind + reason - WRCD_REASON_KIND] = (double)(new_ones < MOST_OF_A_REASON ? new_ones : MOST_OF_A_REASON);
        c->told_refused[reason] = refused;
    }
    told[WRCD_TOLD_ForeignFrames] = (double)(foreign < 0 ? 0 : foreign < MOST_OF_A_REASON ? foreign : MOST_OF_A_REASON);
    c->told_foreign = c->foreign_frames;
}

/* A word's raw value; a number's nearest within the signal's range, or that there is none. */
static uint64_t raw_of(const wrcd_told_field *f, double number)
{
    if (f->is_word)
        return f->word_raw[(int)number];
    if (!isfinite(number))
        return f->not_available;
    number *= f->unit_factor;
    if (number < f->low && f->is_rounded_down && f->low > 0.0)
        return f->not_available; /* the least that can be sent would be more than it is */
    number = number < f->low ? f->low : number > f->high ? f->high : number;
    const double steps = (number - f->offset) / f->scale;
    const double whole = f->rounds < 0 ? floor(steps) : f->rounds > 0 ? ceil(steps) : nearbyint(steps);
    if (whole <= f->lowest || whole >= f->highest) /* a double may not hold the end of a long field */
        return whole <= f->lowest ? f->lowest_raw : f->highest_raw;
    return whole < 0.0 ? (uint64_t)(int64_t)whole : (uint64_t)whole;
}

static void put_bits(uint8_t *data, int length, const wrcd_told_field *f, uint64_t raw)
{
    for (int bit = 0; bit < f->bits; bit++) {
        const int at = f->shift + bit, byte = f->is_big_endian ? length - 1 - at / 8 : at / 8, one = 1 << at % 8;
        if (byte >= 0 && byte < length)
            data[byte] = (uint8_t)(raw >> bit & 1 ? data[byte] | one : data[byte] & ~one);
    }
}

void wrcd_pack(const wrcd_train *t, int number, int64_t counter, const double told[WRCD_TOLD_COUNT], uint8_t data[8])
{
    const wrcd_sent *s = &t->sent[number];

    memcpy(data, s->start, WRCD_MAX_SENT_BYTES);
    for (int k = s->first_told; k < s->first_told + s->told; k++)
        put_bits(data, s->length, &t->told[k], raw_of(&t->told[k], told[t->told[k].what]));
    if (s->is_protected) {
        data[1] = (uint8_t)((data[1] & 0xF0) | remainder_of(counter, COUNTER_MODULO));
        data[0] = wrcd_crc_after((uint8_t)s->crc_start, data, s->length);
    }
}

static void make(const wrcd_train *t, wrcd_out *out, int number, int64_t stamp_us, int64_t counter, const double *told)
{
    const wrcd_sent *s = &t->sent[number];
    wrcd_made *made = &out->made[out->counts[WRCD_OUT_MADE]++];

    *made = (wrcd_made){
        .stamp_us = stamp_us, .word = s->word, .length = (uint8_t)s->length, .cycle_us = s->cycle_us, .report = -1,
        .axle = s->axle};
    wrcd_pack(t, number, counter, told, made->data);
}

static bool any_is_due(const wrcd_train *t, int64_t end_us, bool of_axles[KINDS_OF_AXLES])
{
    bool any = false;

    memset(of_axles, 0, KINDS_OF_AXLES * sizeof *of_axles);
    for (int k = 0; k < t->settings->sent; k++)
        if (t->sent[k].kind < KINDS_OF_AXLES && is_slot(t, t->sent[k].cycle_us, end_us))
            any = of_axles[t->sent[k].kind] = true;
    return any;
}

/* Where each axle stands; whose standing differs from that at the slot before; whether any has an estimate. */
static bool stand(const wrcd_train *t, bool has_changed[WRCD_MAX_AXLES])
{
    bool any = false;

    for (int axle = 0; axle < t->settings->axles; axle++) {
        wrcd_axle_state *a = &t->axle[axle];
        int has_estimate, cause;
        wrcd_standing(a, t->settings->window_ticks, wrcd_pair_state(t->estimator, axle), &has_estimate, &cause);
        has_changed[axle] = has_estimate != a->has_estimate || cause != a->standing;
        a->has_estimate = has_estimate;
        a->standing = cause;
        any = any || has_estimate;
    }
    return any;
}

/* The reports and frames of a slot that begins with a tick's end. */
void wrcd_slot(const wrcd_train *t, wrcd_out *out, int64_t end_us)
{
    double told[WRCD_MAX_AXLES + 1][WRCD_TOLD_COUNT];
    wrcd_adhesion adhesion[WRCD_MAX_AXLES];
    axle_words own[WRCD_MAX_AXLES];
    bool has_changed[WRCD_MAX_AXLES], is_due[KINDS_OF_AXLES];
    const int n = t->settings->axles, first = (int)out->counts[WRCD_OUT_REPORTS];

    if (any_is_due(t, end_us, is_due)) {
        wrcd_report *report = &out->report[first];
        if (stand(t, has_changed)) {
            wrcd_estimate(t->estimator, t->design, adhesion);
            widen(t, adhesion);
            wrcd_axles_fuse(t, adhesion, own);
        }
        for (int axle = 0; axle < n; axle++) {
            report_of(t, axle, end_us, t->axle[axle].has_estimate ? &adhesion[axle] : NULL, &own[axle], &report[axle]);
            tell_adhesion(&report[axle], told[axle]);
            tell_own(&report[axle], told[axle]);
            if (is_due[WRCD_DETAIL] || is_due[WRCD_INPUTS_SEEN]) {
                tell_detail(t, &report[axle], told[axle]);
                tell_inputs(t, &report[axle], told[axle]);
            }
        }
        out->counts[WRCD_OUT_REPORTS] += n;
        wrcd_tell_changes(t, out, report, has_changed);
    }
    for (int k = 0; k < t->settings->sent; k++) {
        const wrcd_sent *s = &t->sent[k];
        if (!is_slot(t, s->cycle_us, end_us))
            continue;
        if (s->kind == WRCD_DAEMON)
            tell_daemon(t, told[WRCD_MAX_AXLES]);
        if (s->kind == WRCD_REJECTS)
            tell_rejects(t, told[WRCD_MAX_AXLES]);
        make(t, out, k, end_us, divided(end_us, s->cycle_us), told[s->axle < 0 ? WRCD_MAX_AXLES : s->axle]);
        if (s->kind == WRCD_ADHESION) {
            wrcd_made *made = &out->made[out->counts[WRCD_OUT_MADE] - 1];
            made->report = first + s->axle;
            made->cause = (uint16_t)out->report[made->report].cause;
        }
    }
}

/* The last frames: every axle NotAvailable, the daemon stopping. The present slot's frames have gone out: the next counter,
 * or a receiver takes these for repeats. */
int wrcd_shutdown(const wrcd_train *t, wrcd_out *out, int64_t now_us)
{
    double told[WRCD_TOLD_COUNT];
    const wrcd_report nothing = {
        .validity = WRCD_NOT_AVAILABLE, .mu_available_pct = NAN, .mu_used_pct = NAN, .sample_age_ms = OLDEST_MS};

    if (out->counts[WRCD_OUT_MADE] + t->settings->sent > out->most[WRCD_OUT_MADE])
        return 0;
    tell_daemon(t, told);
    tell_adhesion(&nothing, told);
    for (int k = 0; k < t->settings->sent; k++)
        if (t->sent[k].kind == WRCD_ADHESION || t->sent[k].is_last)
            make(t, out, k, now_us, divided(now_us, t->sent[k].cycle_us) + 1, told);
    return 1;
}
