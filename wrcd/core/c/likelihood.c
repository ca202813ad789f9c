/* How likely a block's spectra at one frequency are of unknowns, and which way is up: gradient and Fisher matrix of all
 * unknowns, and of the powers of alignment and cross-level, which are free at each frequency and found here. The likelihood is
 * that of wrcd/fit/whittle.py: S = H_y H_y* P_y + H_c H_c* P_c + noise + what is incoherent. */
#include "fit.h"

enum {
    LEAD = OF_VEHICLE, GAIN = LEAD + 2, GYRO_GAIN = GAIN + 2, ASKEW = GYRO_GAIN + 2, LATE = ASKEW + 2, SPEED_SCALE, NOISES,
    ALL = COLUMNS + POWERS, REFINING = 2 /* steps of the powers in a pass */
};
static const double INDEPENDENT = 0.5; /* of Hann windows that overlap by half */
static const double DELTA = 1e-4;      /* of numerical derivatives */

typedef struct { complex_number m[SIGNALS][SIGNALS]; } matrix;
typedef struct { complex_number of[SIGNALS][POWERS]; } sensed;
typedef struct { matrix inverse, white; double fit; } judged; /* L^-1 of S = L L*, L^-1 R L^-* */

double wrcd_dot(const double *a, const double *b, int n)
{
    double sum = 0.0;

    for (int k = 0; k < n; k++)
        sum += a[k] * b[k];
    return sum;
}

void wrcd_eliminate(double *fisher, int width, double *gradient, int first, int end)
{
    for (int p = end - 1; p >= first; p--)
        for (int i = 0; i < p; i++) {
            const double by = fisher[i * width + p] / fisher[p * width + p];
            gradient[i] -= by * gradient[p];
            for (int j = 0; j < p; j++)
                fisher[i * width + j] -= by * fisher[p * width + j];
        }
}

void wrcd_solve(double *fisher, int width, double *gradient, int count, double *out)
{
    wrcd_eliminate(fisher, width, gradient, 0, count);
    for (int i = 0; i < count; i++)
        out[i] = (gradient[i] - wrcd_dot(fisher + i * width, out, i)) / fisher[i * width + i];
}

static double frequency_of(const wrcd_fit_table *f, int bin)
{
    return (f->first_bin + f->bins_apart * bin) / (f->ticks * f->tick_s);
}

/* What the sensors give of the bogie's signals. */
static void sense(const double x[UNKNOWNS], double frequency_hz, complex_number bogie[2][OF_BOGIE][SOURCES], sensed *H)
{
    const double turn = 2.0 * acos(-1.0) * frequency_hz;
    const complex_number late = c_turned(-turn * x[LATE]);

    for (int k = 0; k < 2; k++) {
        const complex_number read = c_scaled(c_turned(-turn * x[LEAD + k]), exp(x[GAIN + k]));
        for (int p = 0; p < POWERS; p++) {
            complex_number yaw = c_scaled(c_sum(bogie[k][0][p], c_scaled(bogie[k][2][p], x[ASKEW + k])), exp(x[GYRO_GAIN + k]));
            complex_number lateral = c_times(bogie[k][1][p], read);
            H->of[2 * k][p] = k == 0 ? yaw : c_times(yaw, late);
            H->of[2 * k + 1][p] = k == 0 ? lateral : c_times(lateral, late);
        }
    }
}

/* The bogie at unknowns and slopes, in a bin of a block. */
static void respond(const wrcd_fit_table *f, const wrcd_bogie_state *b, const double constants[WRCD_BOGIE_CONSTANTS],
                    double speed_scale, const double of_block[OF_BLOCK], int bin, complex_number bogie[2][OF_BOGIE][SOURCES])
{
    const double g22 = f->secant_N * exp(of_block[SECANT]);
    const bogie_moment m = {
        b->of_speed_m_s * exp(speed_scale), g22 * exp(of_block[QUOTIENT]), g22, f->wheelbase_m / b->of_speed_m_s};

    wrcd_bogie_response(constants, &m, frequency_of(f, bin), bogie);
}

static double incoherent_share(const wrcd_fit_table *f, const double of_block[OF_BLOCK])
{
    return f->incoherence * f->incoherence * exp(2.0 * of_block[INCOHERENT]);
}

static void spectra(const wrcd_fit_table *f, const sensed *H, const double powers[POWERS], const double x[UNKNOWNS], double share,
                    matrix *S)
{
    const double P[POWERS] = {exp(powers[0]), exp(powers[1])}, more = 1.0 + share;

    for (int i = 0; i < SIGNALS; i++)
        for (int j = 0; j <= i; j++) {
            complex_number sum = {0.0, 0.0};
            for (int p = 0; p < POWERS; p++)
                sum = c_sum(sum, c_scaled(c_times(H->of[i][p], c_conjugate(H->of[j][p])), P[p]));
            S->m[i][j] = sum;
            S->m[j][i] = c_conjugate(sum);
        }
    for (int i = 0; i < SIGNALS; i++) {
        const double noise = f->noise[i] * exp(x[NOISES + i]);
        S->m[i][i] = (complex_number){S->m[i][i].re * more + noise * noise, 0.0};
    }
}

static void measured(const wrcd_bogie_state *b, int bin, matrix *R)
{
    const double *cross = b->cross[bin];

    for (int c = 0; c < SIGNALS; c++)
        R->m[c][c] = (complex_number){*cross++, 0.0};
    for (int i = 0; i < SIGNALS; i++)
        for (int j = i + 1; j < SIGNALS; j++, cross += 2) {
            R->m[i][j] = (complex_number){cross[0], cross[1]};
            R->m[j][i] = c_conjugate(R->m[i][j]);
        }
}

/* L^-1 A L^-*, L^-1 being lower triangular. */
static void whiten(const matrix *inverse, const matrix *A, matrix *out)
{
    matrix half;

    for (int i = 0; i < SIGNALS; i++)
        for (int j = 0; j < SIGNALS; j++) {
            complex_number sum = {0.0, 0.0};
            for (int k = 0; k <= i; k++)
                sum = c_sum(sum, c_times(inverse->m[i][k], A->m[k][j]));
            half.m[i][j] = sum;
        }
    for (int i = 0; i < SIGNALS; i++)
        for (int j = 0; j <= i; j++) {
            complex_number sum = {0.0, 0.0};
            for (int k = 0; k <= j; k++)
                sum = c_sum(sum, c_times(half.m[i][k], c_conjugate(inverse->m[j][k])));
            out->m[i][j] = sum;
            out->m[j][i] = c_conjugate(sum);
        }
}

/* How likely R is of S, by n independent values. */
static void judge(const matrix *S, const matrix *R, double n, judged *out)
{
    matrix L;
    double log_determinant = 0.0, trace = 0.0;

    memset(&L, 0, sizeof L);
    memset(&out->inverse, 0, sizeof out->inverse);
    for (int j = 0; j < SIGNALS; j++) {
        double rest = S->m[j][j].re;
        for (int k = 0; k < j; k++)
            rest -= c_square(L.m[j][k]);
        L.m[j][j].re = sqrt(rest);
        log_determinant += log(rest);
        for (int i = j + 1; i < SIGNALS; i++) {
            complex_number sum = S->m[i][j];
            for (int k = 0; k < j; k++)
                sum = c_less(sum, c_times(L.m[i][k], c_conjugate(L.m[j][k])));
            L.m[i][j] = c_scaled(sum, 1.0 / L.m[j][j].re);
        }
    }
    for (int j = 0; j < SIGNALS; j++) {
        out->inverse.m[j][j].re = 1.0 / L.m[j][j].re;
        for (int i = j + 1; i < SIGNALS; i++) {
            complex_number sum = {0.0, 0.0};
            for (int k = j; k < i; k++)
                sum = c_less(sum, c_times(L.m[i][k], out->inverse.m[k][j]));
            out->inverse.m[i][j] = c_scaled(sum, 1.0 / L.m[i][i].re);
        }
    }
    whiten(&out->inverse, R, &out->white);
    for (int i = 0; i < SIGNALS; i++)
        trace += out->white.m[i][i].re;
    out->fit = -n * (log_determinant + trace);
}

/* A Hermitian matrix as real numbers with the same sum of squares. */
static void as_real(const matrix *A, double out[AS_REAL])
{
    const double root = sqrt(2.0);

    for (int i = 0; i < SIGNALS; i++)
        *out++ = A->m[i][i].re;
    for (int i = 0; i < SIGNALS; i++)
        for (int j = i + 1; j < SIGNALS; j++) {
            *out++ = root * A->m[i][j].re;
            *out++ = root * A->m[i][j].im;
        }
}

/* What the whitened signals are beyond what is expected. */
static void error_of(const judged *at, double out[AS_REAL])
{
    as_real(&at->white, out);
    for (int i = 0; i < SIGNALS; i++)
        out[i] -= 1.0;
}

/* The whitened derivative by a bin's power. */
static void by_power(const sensed *H, const double powers[POWERS], int p, double share, const judged *at, double out[AS_REAL])
{
    matrix moved, white;

    for (int i = 0; i < SIGNALS; i++)
        for (int j = 0; j < SIGNALS; j++)
            moved.m[i][j] = c_scaled(c_times(H->of[i][p], c_conjugate(H->of[j][p])), exp(powers[p]) * (i == j ? 1.0 + share : 1.0));
    whiten(&at->inverse, &moved, &white);
    as_real(&white, out);
}

static double power_prior(const wrcd_fit_table *f, const double powers[POWERS], const double expected[POWERS])
{
    double sum = 0.0;

    for (int p = 0; p < POWERS; p++)
        sum -= 0.5 * (powers[p] - expected[p]) * (powers[p] - expected[p]) / (f->power_sigma * f->power_sigma);
    return sum;
}

/* Powers of a bin by damped steps of Fisher's. at: how likely the best are. Returns that with their prior. */
static double refine(const wrcd_fit_table *f, const sensed *H, const matrix *R, const double x[UNKNOWNS], double share, double n,
                     int steps, double powers[POWERS], const double expected[POWERS], judged *at)
{
    const double tight = 1.0 / (f->power_sigma * f->power_sigma);
    double damping = 1e-2;
    matrix S;

    spectra(f, H, powers, x, share, &S);
    judge(&S, R, n, at);
    double now = at->fit + power_prior(f, powers, expected);
    for (int k = 0; k < steps; k++) {
        double A[POWERS][AS_REAL], error[AS_REAL], g[POWERS], step[POWERS], moved[POWERS];
        judged next;
        error_of(at, error);
        for (int p = 0; p < POWERS; p++) {
            by_power(H, powers, p, share, at, A[p]);
            g[p] = n * wrcd_dot(A[p], error, AS_REAL) - (powers[p] - expected[p]) * tight;
        }
        const double own[POWERS] = {n * wrcd_dot(A[0], A[0], AS_REAL) + tight, n * wrcd_dot(A[1], A[1], AS_REAL) + tight};
        const double more = damping * (own[0] + own[1]), both = n * wrcd_dot(A[0], A[1], AS_REAL);
        double fisher[POWERS * POWERS] = {own[0] + more, both, both, own[1] + more};
        wrcd_solve(fisher, POWERS, g, POWERS, step);
        for (int p = 0; p < POWERS; p++)
            moved[p] = powers[p] + held(step[p], -2.0, 2.0);
        spectra(f, H, moved, x, share, &S);
        judge(&S, R, n, &next);
        const double then = next.fit + power_prior(f, moved, expected);
        damping = then > now ? damping / 5.0 : damping * 8.0;
        if (then > now) {
            *at = next;
            now = then;
            memcpy(powers, moved, sizeof moved);
        }
    }
    return now;
}

/* Powers to begin with: least squares, the signals in units of their own level. */
static void first_powers(const sensed *H, const matrix *R, double powers[POWERS])
{
    double unit[SIGNALS], both[POWERS * POWERS] = {0.0}, seen[POWERS] = {0.0, 0.0}, found[POWERS];
    complex_number across = {0.0, 0.0};

    for (int i = 0; i < SIGNALS; i++) {
        unit[i] = 1.0 / R->m[i][i].re;
        both[0] += c_square(H->of[i][0]) * unit[i];
        both[3] += c_square(H->of[i][1]) * unit[i];
        across = c_sum(across, c_scaled(c_times(c_conjugate(H->of[i][0]), H->of[i][1]), unit[i]));
    }
    both[0] *= both[0];
    both[3] *= both[3];
    both[1] = both[2] = c_square(across);
    for (int p = 0; p < POWERS; p++)
        for (int i = 0; i < SIGNALS; i++)
            for (int j = 0; j < SIGNALS; j++)
                seen[p] += c_times(c_times(c_conjugate(H->of[i][p]), R->m[i][j]), H->of[j][p]).re * unit[i] * unit[j];
    const double alone[POWERS] = {seen[0] / both[0], seen[1] / both[3]}, ridge = 1e-6 * (both[0] + both[3]);
    both[0] += ridge;
    both[3] += ridge;
    wrcd_solve(both, POWERS, seen, POWERS, found);
    for (int p = 0; p < POWERS; p++)
        powers[p] = log(fmax(found[p], 0.02 * alone[p]));
}

/* The whitened derivative by an unknown, a slope or a power. */
static void column(const wrcd_fit_table *f, const wrcd_bogie_state *b, int bin, int which, const double constants[WRCD_BOGIE_CONSTANTS],
                   complex_number bogie[2][OF_BOGIE][SOURCES], const sensed *H, const matrix *S, const judged *at, double out[AS_REAL])
{
    double x[UNKNOWNS], of_block[OF_BLOCK], changed[WRCD_BOGIE_CONSTANTS];
    complex_number other[2][OF_BOGIE][SOURCES];
    sensed moved = *H;
    matrix after, white;

    memcpy(x, b->at, sizeof x);
    memcpy(of_block, b->of_block, sizeof of_block);
    memcpy(changed, constants, sizeof changed);
    if (which < UNKNOWNS)
        x[which] += DELTA;
    else
        of_block[which - UNKNOWNS] += DELTA;
    if (which < OF_VEHICLE)
        wrcd_bogie_change(changed, which, DELTA);
    if (which < OF_VEHICLE || which == SPEED_SCALE || (which >= UNKNOWNS && which != UNKNOWNS + INCOHERENT)) {
        respond(f, b, changed, x[SPEED_SCALE], of_block, bin, other);
        sense(x, frequency_of(f, bin), other, &moved);
    } else if (which < NOISES) {
        sense(x, frequency_of(f, bin), bogie, &moved);
    }
    spectra(f, &moved, b->powers[bin], x, incoherent_share(f, of_block), &after);
    for (int i = 0; i < SIGNALS; i++)
        for (int j = 0; j < SIGNALS; j++)
            after.m[i][j] = c_scaled(c_less(after.m[i][j], S->m[i][j]), 1.0 / DELTA);
    whiten(&at->inverse, &after, &white);
    as_real(&white, out);
}

/* Gradient and Fisher matrix of a bin by the columns from `from` on, without its powers, added to sums of so many columns. */
static void add_scores(const wrcd_fit_table *f, wrcd_bogie_state *b, int bin, int from, const double constants[WRCD_BOGIE_CONSTANTS],
                       complex_number bogie[2][OF_BOGIE][SOURCES], const sensed *H, const judged *at)
{
    const double n = INDEPENDENT * b->of_stretches, tight = 1.0 / (f->power_sigma * f->power_sigma);
    const double share = incoherent_share(f, b->of_block);
    const int width = ALL - from, kept = COLUMNS - from;
    double A[ALL][AS_REAL], fisher[ALL * ALL], gradient[ALL], error[AS_REAL];
    matrix S;

    spectra(f, H, b->powers[bin], b->at, share, &S);
    error_of(at, error);
    for (int k = 0; k < kept; k++)
        column(f, b, bin, from + k, constants, bogie, H, &S, at, A[k]);
    for (int p = 0; p < POWERS; p++)
        by_power(H, b->powers[bin], p, share, at, A[kept + p]);
    for (int i = 0; i < width; i++) {
        gradient[i] = n * wrcd_dot(A[i], error, AS_REAL);
        for (int j = 0; j <= i; j++)
            fisher[i * width + j] = fisher[j * width + i] = n * wrcd_dot(A[i], A[j], AS_REAL);
    }
    for (int p = 0; p < POWERS; p++) {
        gradient[kept + p] -= (b->powers[bin][p] - b->expected[bin][p]) * tight;
        fisher[(kept + p) * width + kept + p] += tight;
    }
    wrcd_eliminate(fisher, width, gradient, kept, width);
    for (int i = 0; i < kept; i++) {
        b->gradient[from + i] += gradient[i];
        for (int j = 0; j < kept; j++)
            b->fisher[from + i][from + j] += fisher[i * width + j];
    }
}

void wrcd_look_at(const wrcd_fit_table *f, wrcd_bogie_state *b, int bin)
{
    complex_number bogie[2][OF_BOGIE][SOURCES];
    double constants[WRCD_BOGIE_CONSTANTS];
    sensed H;
    matrix R;
    judged at;

    memcpy(constants, f->constants, sizeof constants);
    for (int u = 0; u < OF_VEHICLE; u++)
        wrcd_bogie_change(constants, u, b->at[u]);
    respond(f, b, constants, b->at[SPEED_SCALE], b->of_block, bin, bogie);
    sense(b->at, frequency_of(f, bin), bogie, &H);
    measured(b, bin, &R);
    if (b->pass == FIRST_PASS) {
        first_powers(&H, &R, b->powers[bin]);
        return;
    }
    b->objective += refine(
        f, &H, &R, b->at, incoherent_share(f, b->of_block), INDEPENDENT * b->of_stretches, REFINING, b->powers[bin], b->expected[bin], &at);
    for (int i = 0; i < SIGNALS; i++)
        b->misfit += at.white.m[i][i].re / (SIGNALS * BINS);
    add_scores(f, b, bin, b->pass == LAST_PASS ? 0 : UNKNOWNS, constants, bogie, &H, &at);
}
