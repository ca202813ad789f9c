/* A bogie as transfer functions: what the track's alignment and cross-level make of both wheelsets' signals. The equations
 * are those of wrcd/fit/bogie.py and docs/explanation/vehicle.md, linear about rolling straight on. */
#include "fit.h"

/* Constants by their places: those of BogieConstants in wrcd/fit/bogie.py. */
enum {
    M_W, I_W, R_0, L_G, GAMMA, I_RIGHT, I_LEFT, K_S, C_S, LOAD, SLOPE, M_F, I_F, ARM, K_Y, C_Y, K_PSI, C_PSI, M_B, K_2, C_2,
    K_YAW, C_YAW
};
enum { STATES = 7, LEADING = 0, TRAILING = 2, FRAME = 4, TURN, BODY }; /* y and psi of a wheelset, then the frame's, y of the body */
static const double GRAVITY = 9.80665;
/* What an unknown multiplies. */
static const int CHANGES[OF_VEHICLE][2] = {
    {K_Y, -1}, {C_Y, -1}, {K_PSI, -1}, {C_PSI, -1}, {GAMMA, -1}, {M_W, -1}, {I_W, -1}, {M_F, -1}, {I_F, -1}, {K_2, -1},
    {C_2, -1}, {K_YAW, -1}, {C_YAW, -1}, {R_0, -1}, {K_S, C_S}};

void wrcd_bogie_change(double constants[WRCD_BOGIE_CONSTANTS], int unknown, double log_of_factor)
{
    for (int k = 0; k < 2 && CHANGES[unknown][k] >= 0; k++)
        constants[CHANGES[unknown][k]] *= exp(log_of_factor);
}

typedef struct { complex_number D[STATES][STATES], B[STATES][SOURCES]; } equations;

/* D q = B, Gauss with the largest of a column first; B becomes q. */
static void solve(equations *e)
{
    for (int k = 0; k < STATES; k++) {
        int at = k;
        for (int i = k + 1; i < STATES; i++)
            at = c_square(e->D[i][k]) > c_square(e->D[at][k]) ? i : at;
        for (int j = 0; at != k && j < STATES; j++) {
            const complex_number held = e->D[k][j];
            e->D[k][j] = e->D[at][j];
            e->D[at][j] = held;
        }
        for (int j = 0; at != k && j < SOURCES; j++) {
            const complex_number held = e->B[k][j];
            e->B[k][j] = e->B[at][j];
            e->B[at][j] = held;
        }
        const complex_number inverse = c_over((complex_number){1.0, 0.0}, e->D[k][k]);
        for (int i = k + 1; i < STATES; i++) {
            if (c_square(e->D[i][k]) <= 0.0)
                continue;
            const complex_number by = c_times(e->D[i][k], inverse);
            for (int j = k + 1; j < STATES; j++)
                e->D[i][j] = c_less(e->D[i][j], c_times(by, e->D[k][j]));
            for (int j = 0; j < SOURCES; j++)
                e->B[i][j] = c_less(e->B[i][j], c_times(by, e->B[k][j]));
        }
        e->D[k][k] = inverse;
    }
    for (int k = STATES - 1; k >= 0; k--)
        for (int j = 0; j < SOURCES; j++) {
            complex_number rest = e->B[k][j];
            for (int i = k + 1; i < STATES; i++)
                rest = c_less(rest, c_times(e->D[k][i], e->B[i][j]));
            e->B[k][j] = c_times(rest, e->D[k][k]);
        }
}

/* g11 as it acts on the yaw: wheels and shaft give way. s is 2 pi i f; turn its imaginary part. */
static complex_number slope_of_turning_wheels(const double *c, double turn, const bogie_moment *m)
{
    const complex_number shaft = {c[C_S], -c[K_S] / turn};
    const double creep = c[R_0] * c[R_0] * m->g11_N / m->speed_m_s;
    const complex_number right = {shaft.re + creep, shaft.im + c[I_RIGHT] * turn}, left = {shaft.re + creep, shaft.im + c[I_LEFT] * turn};
    const complex_number both = c_less(c_times(right, left), c_times(shaft, shaft));
    const complex_number turns = c_over((complex_number){2.0 * creep, (c[I_LEFT] + c[I_RIGHT]) * turn}, both);

    return (complex_number){m->g11_N * (1.0 - 0.5 * creep * turns.re), -m->g11_N * 0.5 * creep * turns.im};
}

static void wheelset(const double *c, double turn, const bogie_moment *m, complex_number g11, equations *e, int y, complex_number met)
{
    const int psi = y + 1;
    const double arm = y == LEADING ? c[ARM] : -c[ARM], gravity = 2.0 * c[LOAD] * c[GAMMA] / c[L_G];
    const complex_number k_y = {c[K_Y], c[C_Y] * turn}, k_psi = {c[K_PSI], c[C_PSI] * turn};
    const complex_number cones = c_scaled(g11, 2.0 * c[L_G] * c[GAMMA] / c[R_0]);
    const complex_number creeps = c_times(c_scaled(g11, 2.0 * c[L_G] * c[L_G] / m->speed_m_s), (complex_number){0.0, turn});

    e->D[y][y] = c_sum(k_y, (complex_number){gravity - c[M_W] * turn * turn, 2.0 * m->g22_N * turn / m->speed_m_s});
    e->D[y][psi] = (complex_number){-2.0 * m->g22_N, 0.0};
    e->D[psi][psi] = c_sum(c_sum(creeps, k_psi), (complex_number){-c[I_W] * turn * turn, 0.0});
    e->D[psi][y] = cones;
    e->D[y][FRAME] = e->D[FRAME][y] = c_scaled(k_y, -1.0);
    e->D[y][TURN] = e->D[TURN][y] = c_scaled(k_y, -arm);
    e->D[psi][TURN] = e->D[TURN][psi] = c_scaled(k_psi, -1.0);
    e->B[y][0] = c_scaled(met, gravity);
    e->B[y][1] = c_scaled(met, -c[M_W] * GRAVITY);
    e->B[psi][0] = c_times(cones, met);
}

static void frame_and_body(const double *c, double turn, equations *e, complex_number delay)
{
    const double two = turn * turn, a2 = c[ARM] * c[ARM];
    const complex_number k_2 = {c[K_2], c[C_2] * turn};
    const complex_number mean = c_scaled(c_sum((complex_number){1.0, 0.0}, delay), 0.5); /* cross-level under frame and body */

    e->D[FRAME][FRAME] = c_sum(k_2, (complex_number){2.0 * c[K_Y] - c[M_F] * two, 2.0 * c[C_Y] * turn});
    e->D[FRAME][BODY] = e->D[BODY][FRAME] = c_scaled(k_2, -1.0);
    e->D[BODY][BODY] = (complex_number){k_2.re - c[M_B] * two, k_2.im};
    e->D[TURN][TURN] = (complex_number){
        2.0 * (a2 * c[K_Y] + c[K_PSI]) + c[K_YAW] - c[I_F] * two, (2.0 * (a2 * c[C_Y] + c[C_PSI]) + c[C_YAW]) * turn};
    e->B[FRAME][1] = c_scaled(mean, -c[M_F] * GRAVITY);
    e->B[BODY][1] = c_scaled(mean, -c[M_B] * GRAVITY);
}

void wrcd_bogie_response(const double c[WRCD_BOGIE_CONSTANTS], const bogie_moment *m, double frequency_hz,
                         complex_number out[2][OF_BOGIE][SOURCES])
{
    const double turn = 2.0 * acos(-1.0) * frequency_hz, rolls = c[GAMMA] / c[L_G];
    const complex_number s = {0.0, turn}, one = {1.0, 0.0}, delay = c_turned(-2.0 * turn * c[ARM] / m->speed_m_s);
    const complex_number g11 = slope_of_turning_wheels(c, turn, m), later = c_turned(turn * m->later_s);
    equations e;

    memset(&e, 0, sizeof e);
    wheelset(c, turn, m, g11, &e, LEADING, one);
    wheelset(c, turn, m, g11, &e, TRAILING, delay);
    frame_and_body(c, turn, &e, delay);
    solve(&e);
    for (int k = 0; k < 2; k++)
        for (int source = 0; source < SOURCES; source++) {
            const complex_number met = k == 0 ? one : delay, taken = k == 0 ? one : later, y = e.B[2 * k][source];
            /* a displaced wheelset rolls on its cones */
            const complex_number roll = source == 0 ? c_scaled(c_less(y, met), rolls) : c_sum(met, c_scaled(y, rolls));
            out[k][0][source] = c_times(taken, c_times(s, e.B[2 * k + 1][source]));
            out[k][1][source] = c_times(taken, c_sum(c_scaled(y, -turn * turn), c_scaled(roll, GRAVITY)));
            out[k][2][source] = c_times(taken, c_times(s, roll));
        }
}
