// SPDX-License-Identifier: MIT
// Continuous to discrete and back, for both holds.
#include "mechanics_rig.h"

static okid_status_t d2c(const system_t* from, int32_t hold, system_t* to) {
    const okid_model_t view = s_view(from);
    const size_t bytes = okid_mechanics_hold_memsize(from->n_u, from->n_y, from->n_z);
    void* work = malloc(bytes);
    *to = *from;
    const okid_status_t status = okid_mechanics_d2c(&view, from->dt, hold, to->A, to->B, to->D, work, bytes);
    free(work);
    return status;
}

/// trace of A^2
static double square_trace(const system_t* of) {
    double sum = 0;
    for (int i = 0; i < of->n_z; ++i)
        for (int j = 0; j < of->n_z; ++j) sum += (double)of->A[j * of->n_z + i] * (double)of->A[i * of->n_z + j];
    return sum;
}

enum { BIG = 2 * S_MAX + 4 };
typedef long double wide_t;

static void wide_product(int n, const wide_t* a, const wide_t* b, wide_t* out) {
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            wide_t sum = 0;
            for (int k = 0; k < n; ++k) sum += a[k * n + i] * b[j * n + k];
            out[j * n + i] = sum;
        }
}

/// The reference: exponential of the block matrix in long double, nothing balanced, norm below 1/2.
static void wide_exponential(int n, wide_t* x, wide_t* result) {
    static wide_t spare[BIG * BIG];
    int squarings = 0;
    wide_t norm = 0;
    for (int i = 0; i < n * n; ++i) norm = fmaxl(norm, fabsl(x[i]));
    for (norm *= n; norm > 0.5L; norm /= 2) ++squarings;
    for (int i = 0; i < n * n; ++i) {
        x[i] = ldexpl(x[i], -squarings);
        result[i] = i % (n + 1) == 0;
    }
    for (int k = 30; k >= 1; --k) {
        wide_product(n, x, result, spare);
        for (int i = 0; i < n * n; ++i) result[i] = spare[i] / k + (i % (n + 1) == 0);
    }
    for (int k = 0; k < squarings; ++k) {
        wide_product(n, result, result, spare);
        memcpy(result, spare, sizeof *spare * (size_t)(n * n));
    }
}

/// Errors of m = c sampled with `hold`, against the reference: A, B in states of one size, D. Relative Frobenius.
static void sampling_errors(int32_t hold, double error[3]) {
    static wide_t x[BIG * BIG], e[BIG * BIG];
    const int z = c.n_z, u = c.n_u, n = z + 2 * u;
    memset(x, 0, sizeof x);
    for (int j = 0; j < z; ++j)
        for (int i = 0; i < z; ++i) x[j * n + i] = (wide_t)c.A[j * z + i] * c.dt;
    for (int j = 0; j < u; ++j) {
        for (int i = 0; i < z; ++i) x[(z + j) * n + i] = (wide_t)c.B[j * z + i] * c.dt;
        x[(z + u + j) * n + z + j] = 1;
    }
    wide_exponential(n, x, e);
    wide_t d[6] = {0};
    for (int j = 0; j < z + u; ++j)
        for (int i = 0; i < z; ++i) {
            wide_t expected = e[j * n + i];
            if (j >= z && hold == OKID_HOLD_FIRST) {
                expected -= e[(j + u) * n + i];
                for (int k = 0; k < z; ++k) expected += e[k * n + i] * e[(j + u) * n + k];
            }
            const wide_t one_size = (i < z / 2 ? (wide_t)c.scale : 1) / (j < z / 2 ? (wide_t)c.scale : 1);
            const wide_t found = j < z ? m.A[j * z + i] : m.B[(j - z) * z + i];
            wide_t* sums = j < z ? d : d + 2;
            sums[0] += (found - expected) * one_size * (found - expected) * one_size;
            sums[1] += expected * one_size * expected * one_size;
        }
    for (int j = 0; j < u; ++j)
        for (int o = 0; o < c.n_y; ++o) {
            wide_t expected = c.D[j * c.n_y + o];
            for (int k = 0; k < z && hold == OKID_HOLD_FIRST; ++k)
                expected += (wide_t)c.C[k * c.n_y + o] * e[(z + u + j) * n + k];
            d[4] += (m.D[j * c.n_y + o] - expected) * (m.D[j * c.n_y + o] - expected);
            d[5] += expected * expected;
        }
    for (int i = 0; i < 3; ++i) error[i] = (double)sqrtl(d[2 * i] / (d[2 * i + 1] > 0 ? d[2 * i + 1] : 1));
}

static void sampling_is_exact_to_rounding(void) {
    for (int which = 1; which <= 3; ++which)
        for (int32_t hold = OKID_HOLD_ZERO; hold <= OKID_HOLD_FIRST; ++hold)
            for (int kind = 0; kind < 4; ++kind)
                for (int rate = 0; rate < 3; ++rate) { // highest mode at 0.006, 0.6 and 60 times Nyquist
                    double error[3];
                    make(which, kind % 3, kind == 3);
                    m.dt = c.dt = s.dt * pow(100, rate - 1);
                    TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, hold));
                    sampling_errors(hold, error);
                    // 60 times Nyquist is 113 rad a sample, known to 113 eps, and D is a small difference there
                    const double limit = TOLERANCE(1, 1e9) * (rate == 2 ? 2e-12 : 2e-15);
                    for (int i = 0; i < 3; ++i) TEST_ASSERT_TRUE(error[i] < limit);
                }
}

// A mass on a spring, no damping: a step of force gives F/k (1 - cos wt), a ramp F/k (t - sin(wt)/w); both models take u_n
// alone and are right at every sample, displacement, velocity and acceleration.
static void held_step_and_straight_ramp_are_exact(void) {
    enum { COUNT = 200 };
    const double mass = 2, spring = 800, omega = 20, dt = 0.03, force = 5;
    const int32_t dof[] = {0, 0, 0}, kind[] = {0, 1, 2};
    for (int32_t hold = OKID_HOLD_ZERO; hold <= OKID_HOLD_FIRST; ++hold) {
        memset(&s, 0, sizeof s);
        s.n = 1;
        s.M[0] = (okid_real_t)mass;
        s.K[0] = (okid_real_t)spring;
        s.dt = dt;
        s.omega[0] = s.omega[1] = omega;
        s_instrument(&m, 1, dof, 3, dof, kind);
        TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &m));
        TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, hold));
        double z[2] = {0, 0}; // for the ramp z_0 - G2 u_0 = 0 too, as u_0 = 0
        for (int n = 0; n < COUNT; ++n) {
            const double t = n * dt, u = hold == OKID_HOLD_ZERO ? force : force * t, turn = omega * t;
            const double step[] = {force / spring * (1 - cos(turn)), force / spring * omega * sin(turn),
                                   force / mass * cos(turn)};
            const double ramp[] = {force / spring * (t - sin(turn) / omega), force / spring * (1 - cos(turn)),
                                   force / spring * omega * sin(turn)};
            for (int o = 0; o < 3; ++o) {
                const double y = (double)m.C[o] * z[0] + (double)m.C[3 + o] * z[1] + (double)m.D[o] * u;
                const double expected = hold == OKID_HOLD_ZERO ? step[o] : ramp[o];
                TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-11, 1e-2) * force * (1 + t), expected, y);
            }
            const double first = (double)m.A[0] * z[0] + (double)m.A[2] * z[1] + (double)m.B[0] * u;
            z[1] = (double)m.A[1] * z[0] + (double)m.A[3] * z[1] + (double)m.B[1] * u;
            z[0] = first;
        }
    }
}

static void there_and_back(void) {
    system_t back;
    for (int which = 1; which <= 3; ++which)
        for (int32_t hold = OKID_HOLD_ZERO; hold <= OKID_HOLD_FIRST; ++hold)
            for (int kind = 0; kind < 4; ++kind) {
                make(which, kind % 3, kind == 3);
                TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, hold));
                TEST_ASSERT_EQUAL(OKID_OK, d2c(&m, hold, &back));
                double one_size[S_NZ];
                for (int i = 0; i < m.n_z; ++i) one_size[i] = i < m.n_x ? m.scale : 1;
                s_rescale(&back, one_size);
                s_rescale(&c, one_size);
                TEST_ASSERT_TRUE(s_error(back.A, c.A, c.n_z * c.n_z) < TOLERANCE(1e-13, 1e-4));
                TEST_ASSERT_TRUE(s_error(back.B, c.B, c.n_z * c.n_u) < TOLERANCE(1e-13, 1e-4));
                double d = 0, size = 0; // D beside what the sampling adds to it
                for (int i = 0; i < c.n_y * c.n_u; ++i) {
                    d = fmax(d, fabs((double)back.D[i] - (double)c.D[i]));
                    size = fmax(size, fabs((double)m.D[i]));
                }
                TEST_ASSERT_TRUE(d <= TOLERANCE(1e-13, 1e-4) * size);
            }
}

// Poles on the positive real axis (rigid body with drag, overdamped mass) have a real logarithm too.
static void real_poles_go_back(void) {
    const int32_t dof[] = {0, 1}, kind[] = {0, 1};
    const okid_real_t M[] = {1, 0, 0, 2}, R[] = {3, 0, 0, 40}, K[] = {0, 0, 0, 100};
    for (int32_t hold = OKID_HOLD_ZERO; hold <= OKID_HOLD_FIRST; ++hold) {
        system_t back;
        memset(&s, 0, sizeof s);
        s.n = 2;
        memcpy(s.M, M, sizeof M);
        memcpy(s.R, R, sizeof R);
        memcpy(s.K, K, sizeof K);
        s.dt = 0.05;
        s.omega[0] = s.omega[1] = 7;
        s_instrument(&m, 2, dof, 2, dof, kind);
        TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &m));
        c = m;
        TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, hold));
        TEST_ASSERT_EQUAL(OKID_OK, d2c(&m, hold, &back));
        TEST_ASSERT_TRUE(s_error(back.A, c.A, 16) < TOLERANCE(1e-12, 1e-4));
        TEST_ASSERT_TRUE(s_error(back.B, c.B, 8) < TOLERANCE(1e-12, 1e-4));
        TEST_ASSERT_TRUE(s_error(back.D, c.D, 4) < TOLERANCE(1e-13, 1e-5));
    }
}

// Trap 19: B_c is not B_d/dt; a mode above Nyquist comes back as its alias, silently, as no method could tell; a real
// negative pole has no real logarithm and is refused instead of being turned into something complex or wrong.
static void trap_19_logarithm_and_input_factor(void) {
    system_t back;
    for (int which = 1; which <= 3; ++which) {
        make(which, OKID_SENSE_ACCELERATION, 0);
        TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, OKID_HOLD_ZERO));
        TEST_ASSERT_EQUAL(OKID_OK, d2c(&m, OKID_HOLD_ZERO, &back));
        double right = 0, naive = 0, size = 0;
        for (int j = 0; j < m.n_u; ++j)
            for (int i = 0; i < m.n_z; ++i) {
                const double unit = i < m.n_x ? m.scale : 1, truth = unit * (double)c.B[j * m.n_z + i];
                right += pow(unit * (double)back.B[j * m.n_z + i] - truth, 2);
                naive += pow(unit * (double)m.B[j * m.n_z + i] / m.dt - truth, 2);
                size += truth * truth;
            }
        TEST_ASSERT_TRUE(sqrt(naive / size) > 0.3);
        TEST_ASSERT_TRUE(sqrt(right / size) < TOLERANCE(1e-13, 1e-4));
    }

    make(1, OKID_SENSE_ACCELERATION, 0);
    m.dt = pi / s.omega[1] * 1.2; // the highest mode at 1.2 Nyquist
    TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, OKID_HOLD_ZERO));
    TEST_ASSERT_EQUAL(OKID_OK, d2c(&m, OKID_HOLD_ZERO, &back));
    const double damped = s.omega[1] * sqrt(1 - 1e-4), alias = 2 * pi / m.dt - damped;
    TEST_ASSERT_TRUE(alias < 0.7 * damped);
    // the sum of lambda^2 is the trace of A^2; only the imaginary part of this one pair has moved
    const double moved = square_trace(&back) - square_trace(&c);
    assert_near(2 * damped * damped - 2 * alias * alias, TOLERANCE(1e-11, 1e-3), moved);

    make(1, OKID_SENSE_ACCELERATION, 0);
    TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, OKID_HOLD_ZERO));
    uint64_t seed = 3;
    system_t before = m;
    s_add_pole(&m, -0.4, 0, 1e-3, &seed);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, d2c(&m, OKID_HOLD_ZERO, &back));
    m = before;
    s_add_pole(&m, 0.4, 0, 1e-3, &seed);
    TEST_ASSERT_EQUAL(OKID_OK, d2c(&m, OKID_HOLD_ZERO, &back));
    m = before;
    s_add_pole(&m, 0, 0, 1e-3, &seed);
    TEST_ASSERT_EQUAL(OKID_ERR_MISMATCH, d2c(&m, OKID_HOLD_ZERO, &back));
}

// Trap 16: the same samples mean two forces. What was sampled from a force that goes straight, taken back as if it had been
// held: A is right all the same, B and D are not.
static void trap_16_hold_of_the_force(void) {
    for (int which = 1; which <= 3; ++which) {
        system_t right, wrong;
        make(which, OKID_SENSE_ACCELERATION, 0);
        TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, OKID_HOLD_FIRST));
        TEST_ASSERT_EQUAL(OKID_OK, d2c(&m, OKID_HOLD_FIRST, &right));
        TEST_ASSERT_EQUAL(OKID_OK, d2c(&m, OKID_HOLD_ZERO, &wrong));
        TEST_ASSERT_EQUAL_MEMORY(right.A, wrong.A, sizeof(okid_real_t) * (size_t)(m.n_z * m.n_z));
        TEST_ASSERT_TRUE(s_error(right.D, c.D, c.n_y * c.n_u) < TOLERANCE(1e-13, 1e-4));
        TEST_ASSERT_TRUE(s_error(wrong.D, c.D, c.n_y * c.n_u) > 0.2);
        TEST_ASSERT_TRUE(s_error(wrong.B, c.B, c.n_z * c.n_u) > 0.2);
    }
}

static void wrong_use_is_refused(void) {
    okid_real_t out[S_NZ * S_NZ];
    char work[64];
    make(1, OKID_SENSE_ACCELERATION, 0);
    TEST_ASSERT_EQUAL(0, okid_mechanics_hold_memsize(1, 0, 1));
    okid_model_t view = s_view(&c);
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_mechanics_c2d(&view, 0.01, 0, out, out, out, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_mechanics_d2c(&view, 0.01, 0, out, out, out, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_c2d(&view, 0, 0, out, out, out, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_c2d(&view, NAN, 0, out, out, out, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_c2d(&view, 0.01, 2, out, out, out, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_DIM, okid_mechanics_d2c(&view, -1, 0, out, out, out, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mechanics_c2d(NULL, 0.01, 0, out, out, out, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mechanics_d2c(&view, 0.01, 0, out, NULL, out, work, sizeof work));
    view.C = NULL; // only the first hold needs it
    TEST_ASSERT_EQUAL(OKID_ERR_NULL, okid_mechanics_c2d(&view, 0.01, 1, out, out, out, work, sizeof work));
    TEST_ASSERT_EQUAL(OKID_ERR_MEMORY, okid_mechanics_c2d(&view, 0.01, 0, out, out, out, work, sizeof work));
}

static void what_cannot_be_done_is_said(void) {
    system_t back;
    make(1, OKID_SENSE_ACCELERATION, 0);
    m = c;
    m.A[3] = (okid_real_t)INFINITY;
    const system_t kept = m;
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, s_sample(&m, OKID_HOLD_ZERO));
    TEST_ASSERT_EQUAL_MEMORY(kept.B, m.B, sizeof m.B); // and nothing was written
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, d2c(&m, OKID_HOLD_ZERO, &back));
    // a free mass: two poles at 1 with one eigenvector
    const int32_t dof[] = {0}, kind[] = {0};
    memset(&s, 0, sizeof s);
    s.n = 1;
    s.M[0] = s.omega[0] = s.omega[1] = 1;
    s.dt = 0.1;
    s_instrument(&m, 1, dof, 1, dof, kind);
    TEST_ASSERT_EQUAL(OKID_OK, s_continuous(&s, &m));
    TEST_ASSERT_EQUAL(OKID_OK, s_sample(&m, OKID_HOLD_ZERO));
    TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-16, 1e-8), 0.1, m.A[2]);
    TEST_ASSERT_DOUBLE_WITHIN(TOLERANCE(1e-17, 1e-9), 0.005, m.B[0]);
    TEST_ASSERT_EQUAL(OKID_ERR_NUMERIC, d2c(&m, OKID_HOLD_ZERO, &back));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(sampling_is_exact_to_rounding);
    RUN_TEST(held_step_and_straight_ramp_are_exact);
    RUN_TEST(there_and_back);
    RUN_TEST(real_poles_go_back);
    RUN_TEST(trap_19_logarithm_and_input_factor);
    RUN_TEST(trap_16_hold_of_the_force);
    RUN_TEST(wrong_use_is_refused);
    RUN_TEST(what_cannot_be_done_is_said);
    return UNITY_END();
}
