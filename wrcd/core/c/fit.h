/* Whether a design is this train's: stages of their own, for the core's files only. bogie.c is the model, calm.c what is
 * gathered in ticks, likelihood.c how likely that is, fit.c what it says of the vehicle. Names and priors are those of wrcd/fit. */
#ifndef WRCD_FIT_H
#define WRCD_FIT_H

#include "core.h"

typedef struct { double re, im; } complex_number;
enum { BINS = WRCD_FIT_BINS, SIGNALS = WRCD_FIT_SIGNALS, UNKNOWNS = WRCD_FIT_UNKNOWNS };
enum { OF_BOGIE = 3, SOURCES = 2, OF_BLOCK = 3, POWERS = 2, OF_VEHICLE = 15 }; /* yaw rate, lateral acceleration, roll rate */
enum { SECANT, QUOTIENT, INCOHERENT }; /* unknowns of a block: logs of g22, of g11 / g22, of the share that is incoherent */
enum { COLUMNS = UNKNOWNS + OF_BLOCK, FIRST_PASS = 1, LAST_PASS = 10 };
enum { AS_REAL = SIGNALS * SIGNALS }; /* a Hermitian matrix as so many real numbers */

static inline complex_number c_sum(complex_number a, complex_number b) { return (complex_number){a.re + b.re, a.im + b.im}; }
static inline complex_number c_less(complex_number a, complex_number b) { return (complex_number){a.re - b.re, a.im - b.im}; }
static inline complex_number c_times(complex_number a, complex_number b)
{
    return (complex_number){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
static inline complex_number c_scaled(complex_number a, double by) { return (complex_number){a.re * by, a.im * by}; }
static inline complex_number c_conjugate(complex_number a) { return (complex_number){a.re, -a.im}; }
static inline double c_square(complex_number a) { return a.re * a.re + a.im * a.im; }
static inline complex_number c_over(complex_number a, complex_number b)
{
    return c_scaled(c_times(a, c_conjugate(b)), 1.0 / c_square(b));
}
static inline complex_number c_turned(double angle) { return (complex_number){cos(angle), sin(angle)}; }

static const double UNSURE = 25.0; /* ratio from which a vehicle is not surely the own */

/* bogie.c */
typedef struct { double speed_m_s, g11_N, g22_N, later_s; } bogie_moment;
/* What alignment and cross-level of the track make of both wheelsets' signals, at a frequency. */
void wrcd_bogie_response(const double constants[WRCD_BOGIE_CONSTANTS], const bogie_moment *m, double frequency_hz,
                         complex_number out[2][OF_BOGIE][SOURCES]);
/* The constants times e to the power of an unknown's log. */
void wrcd_bogie_change(double constants[WRCD_BOGIE_CONSTANTS], int unknown, double log_of_factor);

/* calm.c */
/* Gather a tick of a bogie: z [SIGNALS], which are there. Returns whether a block of stretches is complete: it lies in
 * `cross`, `of_speed_m_s` and `of_stretches`. */
bool wrcd_calm_step(const wrcd_fit_table *f, wrcd_bogie_state *b, int64_t tick, const double z[SIGNALS],
                    const bool is_there[SIGNALS], double speed_m_s);

/* likelihood.c */
double wrcd_dot(const double *a, const double *b, int n);
/* Take the unknowns from `first` to `end` out of a Fisher matrix (rows of `width`) and a gradient. */
void wrcd_eliminate(double *fisher, int width, double *gradient, int first, int end);
/* Solve for a few unknowns, of which the matrix (rows of `width`) is no longer needed. */
void wrcd_solve(double *fisher, int width, double *gradient, int count, double *out);
/* Look at one bin of the block in a pass: the first one finds powers to begin with, the others improve them and add to
 * `objective`, `misfit`, `gradient` and `fisher`, the last one those of all unknowns, not only the block's. */
void wrcd_look_at(const wrcd_fit_table *f, wrcd_bogie_state *b, int bin);

/* fit.c */
/* Gather anew; the sum stays. */
void wrcd_fit_reset(wrcd_bogie_state *b);
/* A tick of one bogie, its leading wheelset first; is_reverse: that is the other one than forwards. */
void wrcd_fit_step(const wrcd_fit_table *f, wrcd_bogie_state *b, bool is_reverse, int64_t tick, const double z[SIGNALS],
                   const bool is_there[SIGNALS], double speed_m_s);

#endif
