/* What the sensors bring beside the track: offsets, noise, joints, absurd values. */
#include "parts.h"

/* Second-order sections in cascade (transposed form II) over channels: signal in and out, x [2 count][channels]. */
void wrcd_sections_step(const double *sections, int count, double *x, int channels, double *signal)
{
    for (int k = 0; k < count; k++) {
        const double *f = sections + 6 * k;
        double *first = x + 2 * k * channels, *second = first + channels;
        for (int c = 0; c < channels; c++) {
            const double in = signal[c], out = f[0] * in + first[c];
            first[c] = f[1] * in - f[4] * out + second[c];
            second[c] = f[2] * in - f[5] * out;
            signal[c] = out;
        }
    }
}

/* The mean of all that came so far, then of the last `ticks`, is taken off: z less its offset. */
void wrcd_offset_step(wrcd_axle *a, double ticks, const double z[CHANNELS], bool learns, double deviation[CHANNELS])
{
    for (int c = 0; c < CHANNELS; c++) {
        if (learns) {
            a->offset_count[c] = lesser(a->offset_count[c] + 1.0, ticks);
            a->offset_mean[c] += 1.0 / a->offset_count[c] * (z[c] - a->offset_mean[c]);
        }
        deviation[c] = z[c] - a->offset_mean[c];
    }
}

/* An innovation is an outlier if it is this many times its usual size for every model: yaw rate, lateral acceleration. On 384
 * tracks of lone wheelsets, other worlds and changes of rail included, yaw rates stay below 3.2 (with joints and vibration one
 * of 384 above 4.5), lateral accelerations below 6.3. In a bogie a flange that meets the rail gives more, and after a sample
 * that is left out the next is larger still: with 6 and no more than two outliers for these, too, sound axles were being
 * started anew 2 % of the time, shaken ones 11 %; so 0.0 and 0.1 % (16 axles each). */
static const double GATE_SIGMA[CHANNELS] = {4.5, 12.0};
static const double GATE_MAX_NET_OUTLIERS[CHANNELS] = {2.0, 8.0}; /* outliers less accepted samples */
static const double GATE_MEMORY_TICKS = 100.0; /* over which the usual size is taken */
static const double GATE_MIN_TICKS = 20.0;     /* before it is known well enough to judge by */
/* If one of the first of those ticks holds more than this share of their total power for every model, it was an outlier that
 * widened the gate. Of 177 clean starts the largest was 0.22 for the yaw rate, 0.36 for the lateral acceleration. */
static const double GATE_MAX_PEAK_SHARE = 0.3;
static const double GATE_COMPARED_TICKS = 3.0; /* as old as the yaw rate may be that MAX_JUMP is taken from */

/* An innovation is an outlier if it is many times its usual size for every model, or is no number. */
void wrcd_gate_outliers(const wrcd_axle *a, const double e[MODELS][CHANNELS], double yaw_rate, bool there, bool out[CHANNELS])
{
    for (int c = 0; c < CHANNELS; c++) {
        bool usual = false, finite = true;
        for (int k = 0; k < MODELS; k++) {
            usual = usual || e[k][c] * e[k][c] <= GATE_SIGMA[c] * GATE_SIGMA[c] * a->gate_power[k][c];
            finite = finite && isfinite(e[k][c]);
        }
        out[c] = there && !usual && (a->gate_count[c] >= GATE_MIN_TICKS || !finite);
    }
    if (there && a->gate_age <= GATE_COMPARED_TICKS && fabs(yaw_rate - a->gate_last) > MAX_JUMP)
        out[YAW] = true;
}

/* Learn from a sample that was accepted. Returns whether the axle is to be reset: too many samples were outliers, or one
 * among the first was. */
bool wrcd_gate_learn(wrcd_axle *a, const double e[MODELS][CHANNELS], double yaw_rate, bool used, const bool out[CHANNELS])
{
    bool reset = false;

    a->gate_last = used ? yaw_rate : a->gate_last;
    a->gate_age = used ? 1.0 : a->gate_age + 1.0;
    for (int c = 0; c < CHANNELS; c++) {
        a->gate_net_outliers[c] = greater(a->gate_net_outliers[c] + (out[c] ? 1.0 : 0.0) - (used ? 1.0 : 0.0), 0.0);
        a->gate_count[c] = lesser(a->gate_count[c] + (used ? 1.0 : 0.0), GATE_MEMORY_TICKS);
        const double gain = used ? 1.0 / greater(a->gate_count[c], 1.0) : 0.0;
        const bool early = a->gate_count[c] <= GATE_MIN_TICKS;
        bool alone = used && a->gate_count[c] == GATE_MIN_TICKS;
        for (int k = 0; k < MODELS; k++) {
            const double power = e[k][c] * e[k][c];
            a->gate_power[k][c] += gain * (power - a->gate_power[k][c]);
            a->gate_peak[k][c] = early ? greater(a->gate_peak[k][c], used ? power : 0.0) : 0.0;
            alone = alone && a->gate_peak[k][c] > GATE_MAX_PEAK_SHARE * GATE_MIN_TICKS * a->gate_power[k][c];
        }
        reset = reset || alone || a->gate_net_outliers[c] > GATE_MAX_NET_OUTLIERS[c];
    }
    return reset;
}

/* Why an axle needs a reset, after the tick that showed it: by how many times its usual size each channel's innovation is off,
 * of the model that it fits best, with the limits; by how much the yaw rate differs from the newest that was used, NaN where
 * there is none. */
void wrcd_gate_why(const wrcd_estimator *estimator, int axle, const double e[MODELS][CHANNELS], double yaw_rate,
                   double why[2 * CHANNELS + 1])
{
    const wrcd_axle *a = &estimator->axle[axle];

    for (int c = 0; c < CHANNELS; c++) {
        why[c] = INFINITY;
        why[CHANNELS + c] = GATE_SIGMA[c];
        for (int k = 0; k < MODELS; k++)
            why[c] = fmin(why[c], fabs(e[k][c]) / sqrt(a->gate_power[k][c]));
    }
    why[2 * CHANNELS] = isfinite(a->gate_age) ? fabs(yaw_rate - a->gate_last) : NAN;
}

/* A pulse is so many times the running rms of the accelerometer above the band; the rms is never taken as less than FLOOR of
 * the design's sensor noise, and forgets within 1 / GAIN ticks. A square counts as no more than CLIP of it. */
static const double JOINTS_PULSE_SIGMA = 5.0, JOINTS_FLOOR = 0.8, JOINTS_GAIN = 0.005, JOINTS_CLIP = 9.0;
/* The filters swing as long as this after a pulse: their innovations are large, but no outliers. */
static const double JOINTS_RECOVERY_TICKS = 80.0;
static const double JOINTS_FIRST_TICKS = 20.0; /* the design's noise counts as so many ticks at the start */
static const double JOINTS_NEAR_GAIN = 0.2;    /* share of the gain with which ticks about a pulse count in the rms */
/* A pulse this long is no joint. Larger than this (rad/s, m/s2) it is no joint either, but a wrong sample. */
static const double JOINTS_MAX_TICKS = 24.0;
const double WRCD_MAX_PULSE[CHANNELS] = {0.02, 6.0};

/* Rail joints and crossings: whether the lateral acceleration is a pulse, and whether it is one or just after. */
bool wrcd_joints_step(wrcd_axle *a, const wrcd_design *d, double lat_accel, bool present, bool *near_pulse)
{
    const double noise = JOINTS_FLOOR * d->noise_rms[LAT], floor_power = noise * noise, one = present ? 1.0 : 0.0;

    if (present && a->joints_ticks == 0.0)
        a->joints_first = lat_accel;
    if (present)
        a->joints_newest = lat_accel - a->joints_first;
    double high = a->joints_newest;
    wrcd_sections_step(d->highpass, d->highpass_sections, a->joints_highpass, 1, &high);
    const double square = high * high, usual = greater(a->joints_power, floor_power);
    const bool large = present && square > JOINTS_PULSE_SIGMA * JOINTS_PULSE_SIGMA * usual, before = a->joints_left > 0.0;
    a->joints_length = large ? a->joints_length + 1.0 : before ? a->joints_length : 0.0;
    a->joints_left = large ? (double)WRCD_HOLD + 1.0 : greater(a->joints_left - 1.0, 0.0);
    const bool joint = a->joints_length <= JOINTS_MAX_TICKS, pulse = large && joint;
    *near_pulse = a->joints_left > 0.0 && joint;
    a->joints_ticks = lesser(a->joints_ticks + one, 1.0 / JOINTS_GAIN);
    double gain = present ? greater(JOINTS_GAIN, 1.0 / (a->joints_ticks + JOINTS_FIRST_TICKS)) : 0.0;
    gain *= pulse || (before && joint) ? JOINTS_NEAR_GAIN : 1.0;
    a->joints_power += gain * (lesser(square, JOINTS_CLIP * usual) - a->joints_power);
    a->joints_since = pulse ? 0.0 : lesser(a->joints_since + 1.0, JOINTS_RECOVERY_TICKS + 1.0);
    return pulse;
}

/* Whether a pulse is so recent that the filters still swing. */
bool wrcd_joints_recovering(const wrcd_axle *a) { return a->joints_since <= JOINTS_RECOVERY_TICKS; }

/* White noise of variance 1 leaves 1 + 16 + 36 + 16 + 1 in a fourth difference, the track 1e-4 of its power at 10 Hz. */
static const double NOISE_GAIN = 70.0, NOISE_MEMORY_TICKS = 400.0;
static const double NOISE_FIRST_TICKS = 60.0; /* the design's noise counts as so many ticks at the start */
static const double NOISE_MAX_POWER_RATIO = 9.0; /* a difference counts as no more of the running power: no pulses */
/* Above MAX_FACTOR times the design's noise the signal is no sensor's noise but vibration, most of it above the band that
 * counts; from VIBRATION on, what is taken off is the design's own noise. */
static const double NOISE_MIN_FACTOR = 0.1, NOISE_MAX_FACTOR = 2.2, NOISE_VIBRATION = 3.0;

/* The noise's power over the design's, from fourth differences: what the track does is slow and leaves nothing there. */
void wrcd_noise_step(wrcd_axle *a, const wrcd_design *d, const double z[CHANNELS], bool used)
{
    const bool known = used && a->noise_run >= 4.0;

    for (int c = 0; c < CHANNELS; c++) {
        const double newest = z[c] * (1.0 / d->noise_rms[c]);
        const double difference = a->noise_past[0][c] - 4.0 * a->noise_past[1][c] + 6.0 * a->noise_past[2][c]
            - 4.0 * a->noise_past[3][c] + newest;
        if (known) {
            const double power = lesser(difference * difference / NOISE_GAIN, NOISE_MAX_POWER_RATIO * a->noise_power[c]);
            a->noise_count[c] = lesser(a->noise_count[c] + 1.0, NOISE_MEMORY_TICKS);
            a->noise_power[c] += (power - a->noise_power[c]) / a->noise_count[c];
        }
        for (int k = 0; k < 3; k++)
            a->noise_past[k][c] = a->noise_past[k + 1][c];
        a->noise_past[3][c] = newest;
    }
    a->noise_run = used ? lesser(a->noise_run + 1.0, 4.0) : 0.0;
}

/* The part of it, as rms, that counts as the sensors' noise: what is far above the design's is vibration. */
void wrcd_noise_sensor_factor(const wrcd_axle *a, double factor[CHANNELS])
{
    for (int c = 0; c < CHANNELS; c++) {
        const double f = sqrt(a->noise_power[c]), within = held(f, NOISE_MIN_FACTOR, NOISE_MAX_FACTOR);
        const double vibrates = held((f - NOISE_MAX_FACTOR) / (NOISE_VIBRATION - NOISE_MAX_FACTOR), 0.0, 1.0);
        factor[c] = (1.0 - vibrates) * within + vibrates;
    }
}

/* Start an axle's signals anew; the noise's newest samples stay. */
void wrcd_signals_reset(wrcd_axle *a, const wrcd_design *d)
{
#define CLEAR(field) memset(&a->field, 0, sizeof a->field)
    CLEAR(offset_mean), CLEAR(offset_count), CLEAR(gate_power), CLEAR(gate_peak), CLEAR(gate_count), CLEAR(gate_net_outliers);
    CLEAR(joints_highpass), CLEAR(joints_ticks), CLEAR(joints_left), CLEAR(joints_length), CLEAR(joints_first);
    CLEAR(joints_newest), CLEAR(noise_run), CLEAR(lowpass);
#undef CLEAR
    a->gate_age = INFINITY;
    a->joints_power = d->noise_rms[LAT] * d->noise_rms[LAT];
    a->joints_since = JOINTS_RECOVERY_TICKS + 1.0;
    for (int c = 0; c < CHANNELS; c++) {
        a->noise_power[c] = 1.0;
        a->noise_count[c] = NOISE_FIRST_TICKS;
    }
}
