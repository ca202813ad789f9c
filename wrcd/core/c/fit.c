/* What a bogie's calm signals say of the vehicle: whether they are likelier of another one than of the design's own.
 *
 * The likelihood is that of wrcd/fit/whittle.py: in each bin of a block S = H_y H_y* P_y + H_c H_c* P_c + noise + what is
 * incoherent, with free powers of alignment and cross-level. Here nothing is fitted to all blocks again and again. A block
 * is looked at with the most likely unknowns of a vehicle within the scatter of the design's: powers (of each bin), creep
 * slopes and incoherence (of the block) climb to their best, then come the gradient and the Fisher matrix of the others,
 * without these (Schur complements), and are added to a sum that forgets. Where that leads far, it is looked at again from
 * there. The sum with two priors answers: the design's vehicle within its scatter, and any vehicle. Twice the difference of
 * their log-likelihoods is the ratio. Where that is large, the next blocks are looked at with the other vehicle, too, for how
 * incoherent it leaves them.
 *
 * One bin of a block is looked at in a tick: no tick is long. */
#include "fit.h"

enum {
    LEAD = OF_VEHICLE, GAIN = LEAD + 2, GYRO_GAIN = GAIN + 2, ASKEW = GYRO_GAIN + 2, LATE = ASKEW + 2, SPEED_SCALE, NOISES,
    COLUMNS = UNKNOWNS + OF_BLOCK, ALL = COLUMNS + POWERS
};
enum { SECANT, SLOPE, INCOHERENT }; /* unknowns of a block: logs of g22, of g11 / g22, of the share that is incoherent */
enum { FIRST_PASS = 1, MAX_PASSES = 9, LAST_PASS = 10, REFINING = 2 };
static const double INDEPENDENT = 0.5; /* of Hann windows that overlap by half */
static const double DELTA = 1e-4;      /* of numerical derivatives */
static const double ENOUGH = 0.03, MOST_STEP = 0.5;
static const double KEPT = 0.99;       /* of the sum, at each stretch */
/* Of what is expected: a block that is stronger is another thing, a flange at the rail; one that is weaker is no signal. */
static const double MIN_FIT = 0.3, MAX_FIT = 1.5;
static const double LEAST_SLOPE = -1.2; /* log of the creep force's secant over a damp rail's: near saturation nothing is linear */
static const double LEAST_WEIGHT = 20.0; /* stretches, before there is a verdict */
enum { MOST_AGAIN = 3 };
static const double FAR = 6.0;         /* gain for which a block is looked at once more, from where it led to */
static const double FARTHEST = 0.5;    /* that an unknown moves with a block: all is linear about them */
/* Ratios from which a vehicle is another one, and still is. In 316 simulated hours of own vehicles (off as the training draws
 * them, curves, wet rails, shaken axle boxes) three were called another; of 34 others 33 were found within 26 minutes. */
static const double UNLIKE = 60.0, STILL_UNLIKE = 30.0;
static const double COHERENT = 0.10, STILL_COHERENT = 0.12; /* the most that a vehicle may leave incoherent */
static const double INFORMED_PP = 0.75; /* the most that the bias's standard deviation may be, to call a vehicle the own one */

typedef struct { complex_number m[SIGNALS][SIGNALS]; } matrix;
typedef struct { complex_number of[SIGNALS][POWERS]; } sensed;
typedef struct { matrix inverse, white; double fit; } judged; /* L^-1 of S = L L*, L^-1 R L^-* */

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
        b->of_speed_m_s * exp(speed_scale), g22 * exp(of_block[SLOPE]), g22, f->wheelbase_m / b->of_speed_m_s};

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

static double dot(const double *a, const double *b, int n)
{
    double sum = 0.0;

    for (int k = 0; k < n; k++)
        sum += a[k] * b[k];
    return sum;
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

/* Take the unknowns from `first` to `end` out of a Fisher matrix (rows of `width`) and a gradient. */
static void eliminate(double *fisher, int width, double *gradient, int first, int end)
{
    for (int p = end - 1; p >= first; p--)
        for (int i = 0; i < p; i++) {
            const double by = fisher[i * width + p] / fisher[p * width + p];
            gradient[i] -= by * gradient[p];
            for (int j = 0; j < p; j++)
                fisher[i * width + j] -= by * fisher[p * width + j];
        }
}

/* Solve for a few unknowns, of which the matrix (rows of `width`) is no longer needed. */
static void solve(double *fisher, int width, double *gradient, int count, double *out)
{
    eliminate(fisher, width, gradient, 0, count);
    for (int i = 0; i < count; i++)
        out[i] = (gradient[i] - dot(fisher + i * width, out, i)) / fisher[i * width + i];
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
            g[p] = n * dot(A[p], error, AS_REAL) - (powers[p] - expected[p]) * tight;
        }
        const double own[POWERS] = {n * dot(A[0], A[0], AS_REAL) + tight, n * dot(A[1], A[1], AS_REAL) + tight};
        const double more = damping * (own[0] + own[1]), both = n * dot(A[0], A[1], AS_REAL);
        double fisher[POWERS * POWERS] = {own[0] + more, both, both, own[1] + more};
        solve(fisher, POWERS, g, POWERS, step);
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
    solve(both, POWERS, seen, POWERS, found);
    for (int p = 0; p < POWERS; p++)
        powers[p] = log(fmax(found[p], 0.02 * alone[p]));
}

/* What powers are expected about: a curve of second order over the log of the wave number, which follows them. */
static void smooth(const wrcd_fit_table *f, wrcd_bogie_state *b)
{
    double along[3][POWERS] = {{0.0}};

    for (int k = 0; k < 3; k++)
        for (int bin = 0; bin < BINS; bin++)
            for (int p = 0; p < POWERS; p++)
                along[k][p] += f->basis[k * BINS + bin] * b->powers[bin][p];
    memset(b->expected, 0, sizeof b->expected);
    for (int k = 0; k < 3; k++)
        for (int bin = 0; bin < BINS; bin++)
            for (int p = 0; p < POWERS; p++)
                b->expected[bin][p] += f->basis[k * BINS + bin] * along[k][p];
}

static void own_constants(const wrcd_fit_table *f, const double x[UNKNOWNS], double constants[WRCD_BOGIE_CONSTANTS])
{
    memcpy(constants, f->constants, sizeof f->constants);
    for (int u = 0; u < OF_VEHICLE; u++)
        wrcd_bogie_change(constants, u, x[u]);
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
        gradient[i] = n * dot(A[i], error, AS_REAL);
        for (int j = 0; j <= i; j++)
            fisher[i * width + j] = fisher[j * width + i] = n * dot(A[i], A[j], AS_REAL);
    }
    for (int p = 0; p < POWERS; p++) {
        gradient[kept + p] -= (b->powers[bin][p] - b->expected[bin][p]) * tight;
        fisher[(kept + p) * width + kept + p] += tight;
    }
    eliminate(fisher, width, gradient, kept, width);
    for (int i = 0; i < kept; i++) {
        b->gradient[from + i] += gradient[i];
        for (int j = 0; j < kept; j++)
            b->fisher[from + i][from + j] += fisher[i * width + j];
    }
}

/* Look at one bin of the block in a pass. */
static void look_at(const wrcd_fit_table *f, wrcd_bogie_state *b, int bin)
{
    complex_number bogie[2][OF_BOGIE][SOURCES];
    double constants[WRCD_BOGIE_CONSTANTS];
    sensed H;
    matrix R;
    judged at;

    own_constants(f, b->at, constants);
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

/* What is known of a block's unknowns before. Returns its part of the log-likelihood. */
static double add_block_prior(const wrcd_fit_table *f, wrcd_bogie_state *b)
{
    double sum = 0.0;

    for (int s = 0; s < OF_BLOCK; s++) {
        const double tight = 1.0 / (f->block_sigma[s] * f->block_sigma[s]);
        b->gradient[UNKNOWNS + s] -= b->of_block[s] * tight;
        b->fisher[UNKNOWNS + s][UNKNOWNS + s] += tight;
        sum -= 0.5 * b->of_block[s] * b->of_block[s] * tight;
    }
    return sum;
}

/* What the block adds to the sum: the upper triangle of its Fisher matrix, and its diagonal, which solving overwrites. */
typedef struct { double diagonal[UNKNOWNS], score[UNKNOWNS], kept; } addition;

static double summed(const wrcd_bogie_state *b, const addition *a, int i, int j)
{
    const double of_block = i == j ? a->diagonal[i] : i < j ? b->fisher[i][j] : b->fisher[j][i];

    return a->kept * b->information[i][j] + of_block;
}

/* Solve (sum + prior) x = score by Cholesky, in the lower triangle of the block's Fisher matrix. Returns whether it could be;
 * tells the variance along `along`, too, where that is asked for. */
static bool solve_sum(wrcd_bogie_state *b, const addition *a, const double sigma[UNKNOWNS], double x[UNKNOWNS], const double *along,
                      double *variance)
{
    double half[UNKNOWNS];

    for (int i = 0; i < UNKNOWNS; i++)
        for (int j = 0; j <= i; j++) {
            double rest = summed(b, a, i, j) + (i == j ? 1.0 / (sigma[i] * sigma[i]) : 0.0);
            rest -= dot(b->fisher[i], b->fisher[j], j);
            if (i == j && !(rest > 0.0))
                return false;
            b->fisher[i][j] = i == j ? sqrt(rest) : rest / b->fisher[j][j];
        }
    for (int i = 0; i < UNKNOWNS; i++)
        x[i] = (a->score[i] - dot(b->fisher[i], x, i)) / b->fisher[i][i];
    for (int i = UNKNOWNS - 1; i >= 0; i--) {
        for (int j = i + 1; j < UNKNOWNS; j++)
            x[i] -= b->fisher[j][i] * x[j];
        x[i] /= b->fisher[i][i];
    }
    for (int i = 0; along != NULL && i < UNKNOWNS; i++)
        half[i] = (along[i] - dot(b->fisher[i], half, i)) / b->fisher[i][i];
    if (along != NULL)
        *variance = dot(half, half, UNKNOWNS);
    return true;
}

/* What is gained, were all linear, by going from the unknowns to the sum's. */
static double gain_of(const wrcd_bogie_state *b, const addition *a, const double sigma[UNKNOWNS], const double own[UNKNOWNS])
{
    double gain = 0.0;

    for (int i = 0; i < UNKNOWNS; i++) {
        double rest = a->score[i] - b->at[i] / (sigma[i] * sigma[i]);
        for (int j = 0; j < UNKNOWNS; j++)
            rest -= summed(b, a, i, j) * b->at[j];
        gain += rest * (own[i] - b->at[i]);
    }
    return gain;
}

/* Of a block that is added: by how much a vehicle leaves it incoherent. */
static void note_incoherence(wrcd_bogie_state *b, bool another, double kept, double log_of_share)
{
    b->incoherent[another] = kept * b->incoherent[another] + b->of_stretches * log_of_share;
    b->looks[another] = kept * b->looks[another] + b->of_stretches;
}

static double incoherence_of(const wrcd_fit_table *f, const wrcd_bogie_state *b, bool another)
{
    return b->looks[another] > 0.0 ? f->incoherence * exp(b->incoherent[another] / b->looks[another]) : INFINITY;
}

/* Another vehicle has to be far likelier, and to explain what the sensors give: those of a shaken axle box it does not. Nor is
 * a vehicle the own one where that does not explain them, or where they tell nothing. */
static int verdict_of(const wrcd_fit_table *f, const wrcd_bogie_state *b)
{
    const bool still = b->verdict == WRCD_FIT_UNLIKE;

    if (b->ratio >= (still ? STILL_UNLIKE : UNLIKE) && incoherence_of(f, b, true) <= (still ? STILL_COHERENT : COHERENT))
        return WRCD_FIT_UNLIKE;
    if (b->ratio >= UNSURE || b->incoherence > COHERENT)
        return WRCD_FIT_UNSURE;
    return b->bias_sigma_pp <= INFORMED_PP ? WRCD_FIT_LIKE : WRCD_FIT_UNKNOWN;
}

static void go_to(const wrcd_bogie_state *b, const double own[UNKNOWNS], double to[UNKNOWNS])
{
    for (int u = 0; u < UNKNOWNS; u++)
        to[u] = b->at[u] + held(own[u] - b->at[u], -FARTHEST, FARTHEST);
}

/* A block that is not added ages what was: a verdict without new ones ends. One from before the train turned round holds. */
static bool refuse(wrcd_bogie_state *b, double kept)
{
    const bool spoke = b->weight >= LEAST_WEIGHT;

    b->weight *= kept;
    for (int i = 0; i < UNKNOWNS; i++) {
        b->score[i] *= kept;
        for (int j = 0; j < UNKNOWNS; j++)
            b->information[i][j] *= kept;
    }
    b->verdict = spoke && b->weight < LEAST_WEIGHT ? WRCD_FIT_UNKNOWN : b->verdict;
    return true;
}

/* Add the block to the sum, and ask it. Returns false where the block is to be looked at once more, from nearer. */
static bool conclude(const wrcd_fit_table *f, wrcd_bogie_state *b)
{
    double free[UNKNOWNS], own[UNKNOWNS], variance = 0.0;
    addition a = {.kept = pow(KEPT, b->of_stretches)};

    if (!(b->misfit >= MIN_FIT && b->misfit <= MAX_FIT && b->of_block[SECANT] >= LEAST_SLOPE))
        return refuse(b, a.kept);
    add_block_prior(f, b);
    eliminate(&b->fisher[0][0], COLUMNS, b->gradient, UNKNOWNS, COLUMNS);
    for (int i = 0; i < UNKNOWNS; i++) {
        a.diagonal[i] = b->fisher[i][i];
        a.score[i] = a.kept * b->score[i] + b->gradient[i] + dot(b->fisher[i], b->at, UNKNOWNS);
    }
    if (!solve_sum(b, &a, f->own_sigma, own, NULL, NULL) || !isfinite(dot(a.score, own, UNKNOWNS)))
        return refuse(b, a.kept);
    if (b->again < MOST_AGAIN && gain_of(b, &a, f->own_sigma, own) > FAR) {
        go_to(b, own, b->at);
        b->again++;
        return false;
    }
    if (!solve_sum(b, &a, f->free_sigma, free, f->bias, &variance))
        return refuse(b, a.kept);
    for (int i = 0; i < UNKNOWNS; i++)
        for (int j = i; j < UNKNOWNS; j++)
            b->information[i][j] = b->information[j][i] = summed(b, &a, i, j);
    memcpy(b->score, a.score, sizeof a.score);
    b->weight = a.kept * b->weight + b->of_stretches;
    go_to(b, own, b->unknowns);
    note_incoherence(b, false, a.kept, b->of_block[INCOHERENT]);
    if (!isnan(b->of_another))
        note_incoherence(b, true, a.kept, b->of_another);
    if (b->weight < LEAST_WEIGHT && b->verdict != WRCD_FIT_UNKNOWN) /* what was said before the train turned round holds */
        return true;
    b->ratio = dot(free, b->score, UNKNOWNS) - dot(own, b->score, UNKNOWNS);
    b->bias_pp = dot(free, f->bias, UNKNOWNS);
    b->bias_sigma_pp = sqrt(variance);
    b->incoherence = incoherence_of(f, b, false);
    memcpy(b->free, free, sizeof free);
    b->verdict = b->weight < LEAST_WEIGHT ? WRCD_FIT_UNKNOWN : verdict_of(f, b);
    return true;
}

static void look_from(wrcd_bogie_state *b, bool another)
{
    b->is_of_another = another;
    memcpy(b->at, another ? b->free : b->unknowns, sizeof b->at);
    memcpy(b->of_block, b->best_of_block, sizeof b->of_block); /* of the block before: the rail changes slowly */
    b->pass = FIRST_PASS;
}

/* The end of a pass: the next step of the block's unknowns, or the last pass at the best. */
static void end_pass(const wrcd_fit_table *f, wrcd_bogie_state *b)
{
    double size = 0.0;

    if (b->pass > FIRST_PASS) {
        b->objective += add_block_prior(f, b);
        if (b->pass == FIRST_PASS + 1 || b->objective > b->best) {
            b->best = b->objective;
            memcpy(b->best_of_block, b->of_block, sizeof b->of_block);
            solve(&b->fisher[UNKNOWNS][UNKNOWNS], COLUMNS, b->gradient + UNKNOWNS, OF_BLOCK, b->step);
        } else {
            for (int s = 0; s < OF_BLOCK; s++)
                b->step[s] *= 0.25;
        }
        for (int s = 0; s < OF_BLOCK; s++) {
            b->step[s] = held(b->step[s], -MOST_STEP, MOST_STEP);
            size = fmax(size, fabs(b->step[s]));
            b->of_block[s] = b->best_of_block[s] + b->step[s];
        }
        if (!(size >= ENOUGH) || b->pass + 1 >= MAX_PASSES) {
            memcpy(b->of_block, b->best_of_block, sizeof b->of_block);
            b->pass = LAST_PASS - 1;
            if (b->is_of_another) {
                b->of_another = b->of_block[INCOHERENT];
                look_from(b, false);
                return;
            }
        }
    }
    smooth(f, b);
    b->pass++;
    b->objective = b->misfit = 0.0;
    memset(b->fisher, 0, sizeof b->fisher);
    memset(b->gradient, 0, sizeof b->gradient);
}

void wrcd_fit_reset(wrcd_bogie_state *b)
{
    memset(&b->ticks, 0, offsetof(wrcd_bogie_state, information) - offsetof(wrcd_bogie_state, ticks));
}

void wrcd_fit_step(const wrcd_fit_table *f, wrcd_bogie_state *b, bool is_reverse, int64_t tick, const double z[SIGNALS],
                   const bool is_there[SIGNALS], double speed_m_s)
{
    if (b->is_reverse != is_reverse) /* each sensor's errors are another wheelset's now; what was said holds until there is more */
        memset(&b->ticks, 0, sizeof *b - offsetof(wrcd_bogie_state, ticks));
    b->is_reverse = is_reverse;
    if (b->pass > 0) {
        look_at(f, b, b->bin++);
        if (b->bin == BINS && b->pass == LAST_PASS)
            b->pass = conclude(f, b) ? 0 : FIRST_PASS;
        if (b->bin == BINS && b->pass > 0)
            end_pass(f, b);
        b->bin = b->bin == BINS ? 0 : b->bin;
    }
    if (wrcd_calm_step(f, b, tick, z, is_there, speed_m_s)) {
        b->bin = b->again = 0;
        b->of_another = NAN;
        look_from(b, b->ratio >= UNSURE);
    }
}
