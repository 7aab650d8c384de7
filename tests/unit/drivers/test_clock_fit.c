// SPDX-License-Identifier: MIT
// Simulated devices and hosts. Truth is host time by a perfect clock; errors are of drv_clock_fit_map() against it.
// Tolerances: 50 us rms at 1 ms jitter, 50 ppm and 1 % outliers (the figure asked for); half a tick where that is 1 ms
// (a sender in step with the ticks never shows where in them it stands); reported sigma within a factor 2.
#include <drv/clock_fit.h>

#include <errno.h>
#include <math.h>
#include <string.h>
#include <unity.h>

static const int64_t origin_ns = 1700000000000000000;
static uint64_t state;

static double uniform(void) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    uint64_t x = state ^ (state >> 33);
    x *= 0xff51afd7ed558ccdu;
    x ^= x >> 33;
    return ((double)(x >> 11) + 0.5) / 9007199254740992.0;
}
static double normal(void) { return sqrt(-2 * log(uniform())) * cos(6.283185307179586 * uniform()); }
static void seed(uint64_t number) {
    state = number * 0x9E3779B97F4A7C15u + 1;
    (void)uniform();
}

typedef enum delay_t { EXPONENTIAL, UNIFORM, HALF_NORMAL, NORMAL, GAMMA_2 } delay_t;

/// A device clock, and a host that stamps with a delay of 1 ms.
typedef struct rig_t {
    drv_clock_config_t config;
    drv_clock_fit_t fit;
    delay_t delay;
    double ppm, begin_s; ///< of the device clock
    double host_step_s;
    double outliers;
} rig_t;

static const struct {
    double hz;
    int32_t bits;
} clocks[] = {{1e3, 16}, {1e6, 32}, {40e6, 32}, {1e9, 64}};

static void start(rig_t* rig, int clock, delay_t delay, double outliers) {
    memset(rig, 0, sizeof *rig);
    rig->config.tick_hz = clocks[clock].hz;
    rig->config.stamp_bits = clocks[clock].bits;
    rig->config.jitter = delay == NORMAL ? DRV_CLOCK_SYMMETRIC : DRV_CLOCK_LATE;
    rig->delay = delay;
    rig->ppm = 50 * (2 * uniform() - 1);
    rig->begin_s = 5000 * uniform();
    rig->outliers = outliers;
    TEST_ASSERT_EQUAL_INT(0, drv_clock_fit_init(&rig->fit, &rig->config));
}

static double delay_of(const rig_t* rig) {
    double d = 0;
    switch (rig->delay) {
    case EXPONENTIAL: d = -1e-3 * log(uniform()); break;
    case UNIFORM: d = 1e-3 * uniform(); break;
    case HALF_NORMAL: d = 1e-3 * fabs(normal()); break;
    case NORMAL: d = 1e-3 * normal(); break;
    case GAMMA_2: d = -0.5e-3 * log(uniform() * uniform()); break; // two waits in a row: short delays are rare
    }
    if (uniform() < rig->outliers) d += uniform() < 0.5 ? 6 * uniform() : 0.03 * (uniform() - 0.5); // early ones too
    return d;
}

/// One event at true time t: its stamp, and the true host time of that tick in *tick_s.
static uint64_t stamp_at(const rig_t* rig, double t, double* tick_s) {
    double ticks = floor((rig->begin_s + t) / (1 + 1e-6 * rig->ppm) * rig->config.tick_hz);
    double middle = rig->delay == NORMAL ? 0.5 : 0;
    *tick_s = (ticks + middle) / rig->config.tick_hz * (1 + 1e-6 * rig->ppm) - rig->begin_s;
    uint64_t mask = rig->config.stamp_bits == 64 ? UINT64_MAX : ((uint64_t)1 << rig->config.stamp_bits) - 1;
    return (uint64_t)ticks & mask;
}

static drv_clock_verdict_t event(rig_t* rig, double t, double* error_s, double* sigma_s) {
    double tick_s = 0;
    uint64_t stamp = stamp_at(rig, t, &tick_s);
    int64_t host = origin_ns + llround(1e9 * (t + rig->host_step_s + delay_of(rig)));
    drv_clock_verdict_t verdict = drv_clock_fit_add(&rig->fit, stamp, host);
    int64_t mapped = 0;
    *error_s = 0;
    if (drv_clock_fit_map(&rig->fit, stamp, &mapped, sigma_s) == 0)
        *error_s = 1e-9 * (double)(mapped - origin_ns) - (tick_s + rig->host_step_s);
    return verdict;
}

/// Events from t0 to t1; root mean square of the error over those from `from` on.
static double play(rig_t* rig, double rate_hz, double t0, double t1, double from) {
    double sum = 0, error = 0, sigma = 0;
    long count = 0;
    for (long k = 0; t0 + (double)k / rate_hz < t1; ++k) {
        double t = t0 + ((double)k + 0.3 * uniform()) / rate_hz;
        (void)event(rig, t, &error, &sigma);
        if (t >= from) sum += error * error, ++count;
    }
    return sqrt(sum / (double)count);
}

void setUp(void) {}
void tearDown(void) {}

static void test_what_is_asked_for(void) {
    double sum[5] = {0};
    enum { SEEDS = 500 };
    for (uint64_t i = 0; i < SEEDS; ++i) {
        seed(i);
        rig_t rig;
        start(&rig, 1 + (int)(i / 5 % 3), (delay_t)(i % 5), 0.01);
        double rms = play(&rig, 500, 0, 40, 15);
        sum[i % 5] += rms * rms;
        TEST_ASSERT_EQUAL_UINT64(0, rig.fit.host_steps + rig.fit.restarts);
        TEST_ASSERT_TRUE(rig.fit.outliers > 20 && rig.fit.outliers < 200); // 100 are grossly off
    }
    for (int kind = 0; kind < 5; ++kind) TEST_ASSERT_TRUE(sqrt(sum[kind] / (SEEDS / 5.0)) < 50e-6);
    for (int kind = 0; kind < 3; ++kind) // one-sided: the edge is sharp
        TEST_ASSERT_TRUE(sqrt(sum[kind] / (SEEDS / 5.0)) < 15e-6);
}

/// The error a fit of a few seconds may have.
static double allowed(const rig_t* rig, double fine_s) { return rig->config.tick_hz == 1e3 ? 0.5e-3 : fine_s; }

static void test_milliseconds(void) {
    for (uint64_t i = 0; i < 40; ++i) {
        seed(500 + i);
        rig_t rig;
        start(&rig, 0, (delay_t)(i % 4), 0.01);
        TEST_ASSERT_TRUE(play(&rig, 500, 0, 40, 15) < allowed(&rig, 0));
    }
}

static void test_sigma_is_honest(void) {
    for (int kind = 0; kind < 4; kind += 3) {
        double offset = 0, rate = 0;
        enum { SEEDS = 200 };
        for (uint64_t i = 0; i < SEEDS; ++i) {
            seed(1000 + i);
            rig_t rig;
            start(&rig, 1 + (int)(i % 3), (delay_t)kind, 0.01);
            (void)play(&rig, 200, 0, 30, 29);
            double error = 0, sigma = 0, ppm = 0, sigma_ppm = 0;
            (void)event(&rig, 30.5, &error, &sigma);
            offset += pow(error / sigma, 2);
            TEST_ASSERT_EQUAL_INT(0, drv_clock_fit_rate(&rig.fit, &ppm, &sigma_ppm));
            rate += pow((ppm - rig.ppm) / sigma_ppm, 2);
        }
        offset = sqrt(offset / SEEDS), rate = sqrt(rate / SEEDS);
        TEST_ASSERT_TRUE(offset > 0.5 && offset < 2);
        TEST_ASSERT_TRUE(rate > 0.5 && rate < 2);
    }
}

/// After six to ten seconds, too, where there are few points to tell their own scatter.
static void test_sigma_is_honest_early(void) {
    enum { SEEDS = 1000 };
    int far = 0;
    for (uint64_t i = 0; i < SEEDS; ++i) {
        seed(1500 + i);
        rig_t rig;
        start(&rig, 1 + (int)(i % 3), i & 1 ? NORMAL : EXPONENTIAL, 0);
        double ppm = 0, sigma_ppm = 0, seconds = 6.5 + (double)(i % 5);
        (void)play(&rig, 100, 0, seconds, 0);
        TEST_ASSERT_EQUAL_INT(0, drv_clock_fit_rate(&rig.fit, &ppm, &sigma_ppm));
        far += fabs(ppm - rig.ppm) > 5 * sigma_ppm;
    }
    TEST_ASSERT_TRUE(far <= 2);
}

/// A sender that is late for a while by the same is no step of the host's clock; a step by as much, which stays, is one.
static void test_stalls_of_a_sender(void) {
    for (uint64_t i = 0; i < 200; ++i) {
        seed(1700 + i);
        rig_t rig;
        start(&rig, (int)(i % 4), (delay_t)(i / 4 % 3), 0);
        double error = 0, sigma = 0, t = 8;
        (void)play(&rig, 100, 0, t, t);
        for (int stall = 0; stall < 20; ++stall, t += 1) {
            rig.host_step_s = 0.03 + 0.4 * uniform();
            (void)play(&rig, 100, t, t + 0.1 + 0.7 * uniform(), t);
            rig.host_step_s = 0;
            (void)play(&rig, 100, t + 0.8, t + 1, t);
        }
        TEST_ASSERT_EQUAL_UINT64(0, rig.fit.host_steps + rig.fit.restarts);
        TEST_ASSERT_TRUE(play(&rig, 100, t, t + 8, t) < allowed(&rig, 150e-6));
        t += 8, rig.host_step_s = 0.03 + 0.4 * uniform();
        int told = 0;
        for (int k = 0; k < 150; ++k) told += event(&rig, t + 0.01 * (double)k, &error, &sigma) == DRV_CLOCK_HOST_STEP;
        TEST_ASSERT_EQUAL_INT(1, told);
    }
}

static void test_host_clock_is_set(void) {
    for (uint64_t i = 0; i < 1000; ++i) {
        seed(2000 + i);
        rig_t rig;
        start(&rig, (int)(i % 4), (delay_t)(i / 4 % 4), 0.01);
        double at = 5 + 10 * uniform(), error = 0, sigma = 0;
        (void)play(&rig, 100, 0, at, at - 1);
        rig.host_step_s = i & 1 ? 3600 : -3600;
        int told = 0;
        long taken = 0;
        for (long k = 0; k < 60; ++k) {
            if (event(&rig, at + 0.01 * (double)k, &error, &sigma) != DRV_CLOCK_HOST_STEP) continue;
            ++told;
            taken = k;
        }
        TEST_ASSERT_EQUAL_INT(1, told);
        TEST_ASSERT_TRUE(taken < 30);
        double rms = play(&rig, 100, at + 0.6, at + 20, at + 10);
        TEST_ASSERT_TRUE(rms < allowed(&rig, rig.delay == NORMAL ? 300e-6 : 150e-6)); // 10 s at 100 Hz
        TEST_ASSERT_EQUAL_UINT64(1, rig.fit.host_steps);
        TEST_ASSERT_EQUAL_UINT64(0, rig.fit.restarts);
    }
}

static void test_device_begins_anew(void) {
    for (uint64_t i = 0; i < 1000; ++i) {
        seed(4000 + i);
        rig_t rig;
        start(&rig, (int)(i % 4), (delay_t)(i / 4 % 4), 0.01);
        rig.begin_s = 10 + 20 * uniform();
        double at = 5 + 10 * uniform(), off = 0.2 + 2 * uniform(), error = 0, sigma = 0;
        (void)play(&rig, 100, 0, at, at - 1);
        rig.begin_s = -(at + off) + 0.1; // it has run for 0.1 s when it speaks again
        int told = 0;
        for (long k = 0; k < 60; ++k)
            told += event(&rig, at + off + 0.01 * (double)k, &error, &sigma) == DRV_CLOCK_RESTART;
        TEST_ASSERT_EQUAL_INT(1, told);
        double rms = play(&rig, 100, at + off + 0.6, at + 20, at + 12);
        TEST_ASSERT_TRUE(rms < allowed(&rig, rig.delay == NORMAL ? 300e-6 : 150e-6));
        TEST_ASSERT_EQUAL_UINT64(0, rig.fit.host_steps);
    }
}

/// However long the pause, the stamp's rounds are counted right: 16-bit milliseconds go round in 65.5 s.
static void test_pauses_over_wraps(void) {
    for (uint64_t i = 0; i < 1000; ++i) {
        seed(6000 + i);
        rig_t rig;
        start(&rig, (int)(i % 4), (delay_t)(i / 4 % 3), 0);
        (void)play(&rig, 200, 0, 20, 19);
        double at = 20 + 1000 * uniform();
        double rms = play(&rig, 200, at, at + 20, at + 5);
        TEST_ASSERT_TRUE(rms < allowed(&rig, 60e-6));
        TEST_ASSERT_EQUAL_UINT64(0, rig.fit.outliers + rig.fit.host_steps + rig.fit.restarts);
    }
}

static void test_outliers_that_agree(void) {
    seed(1);
    rig_t rig;
    start(&rig, 1, EXPONENTIAL, 0);
    double error = 0, sigma = 0;
    (void)play(&rig, 100, 0, 10, 9);
    rig.host_step_s = 2;
    for (int k = 0; k < 7; ++k) TEST_ASSERT_EQUAL_INT(DRV_CLOCK_OUTLIER, event(&rig, 10 + 0.01 * k, &error, &sigma));
    rig.host_step_s = 0;
    TEST_ASSERT_EQUAL_INT(DRV_CLOCK_USED, event(&rig, 10.08, &error, &sigma));
    TEST_ASSERT_TRUE(fabs(error) < 150e-6);
    rig.host_step_s = -2;
    for (int k = 0; k < 7; ++k) TEST_ASSERT_EQUAL_INT(DRV_CLOCK_OUTLIER, event(&rig, 10.1 + 0.01 * k, &error, &sigma));
    TEST_ASSERT_EQUAL_INT(DRV_CLOCK_HOST_STEP, event(&rig, 10.18, &error, &sigma));
    TEST_ASSERT_EQUAL_INT(-EAGAIN, drv_clock_fit_rate(&rig.fit, &error, &sigma)); // the offset is not known yet
}

/// A first pair that is wrong is no step.
static void test_wrong_from_the_start(void) {
    seed(2);
    rig_t rig;
    start(&rig, 2, UNIFORM, 0);
    double error = 0, sigma = 0;
    rig.host_step_s = 6;
    TEST_ASSERT_EQUAL_INT(DRV_CLOCK_USED, event(&rig, 0, &error, &sigma));
    rig.host_step_s = 0;
    TEST_ASSERT_TRUE(play(&rig, 200, 0.01, 20, 10) < 50e-6);
    TEST_ASSERT_EQUAL_UINT64(0, rig.fit.host_steps + rig.fit.restarts);
}

static void test_slow_and_odd_clocks(void) {
    seed(3);
    rig_t rig;
    start(&rig, 1, EXPONENTIAL, 0);
    TEST_ASSERT_TRUE(play(&rig, 10, 0, 300, 200) < 100e-6);
    start(&rig, 1, EXPONENTIAL, 0);
    TEST_ASSERT_TRUE(play(&rig, 1, 0, 1000, 500) < 500e-6);
    start(&rig, 1, UNIFORM, 0);
    rig.config.tick_hz = 1e6 / 3;
    TEST_ASSERT_EQUAL_INT(0, drv_clock_fit_init(&rig.fit, &rig.config));
    TEST_ASSERT_TRUE(play(&rig, 200, 0, 30, 20) < 50e-6);
}

static void test_refusals(void) {
    drv_clock_fit_t fit;
    const drv_clock_config_t good = {1e6, 32, DRV_CLOCK_LATE, 0, 0};
    drv_clock_config_t bad = good;
    TEST_ASSERT_EQUAL_INT(0, drv_clock_fit_init(&fit, &good));
    int64_t host = 0;
    TEST_ASSERT_EQUAL_INT(-EAGAIN, drv_clock_fit_map(&fit, 1, &host, NULL));
    bad.tick_hz = 0;
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_clock_fit_init(&fit, &bad));
    bad = good, bad.stamp_bits = 16; // goes round in 65 ms
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_clock_fit_init(&fit, &bad));
    bad = good, bad.stamp_bits = 65;
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_clock_fit_init(&fit, &bad));
    bad = good, bad.jitter_s = -1;
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_clock_fit_init(&fit, &bad));
    bad = good, bad.rate_ppm = NAN;
    TEST_ASSERT_EQUAL_INT(-EINVAL, drv_clock_fit_init(&fit, &bad));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_what_is_asked_for);
    RUN_TEST(test_milliseconds);
    RUN_TEST(test_sigma_is_honest);
    RUN_TEST(test_sigma_is_honest_early);
    RUN_TEST(test_stalls_of_a_sender);
    RUN_TEST(test_host_clock_is_set);
    RUN_TEST(test_device_begins_anew);
    RUN_TEST(test_pauses_over_wraps);
    RUN_TEST(test_outliers_that_agree);
    RUN_TEST(test_wrong_from_the_start);
    RUN_TEST(test_slow_and_odd_clocks);
    RUN_TEST(test_refusals);
    return UNITY_END();
}
