// SPDX-License-Identifier: MIT
// PURPOSE  device clock to host clock: offset and rate with σ, whatever the host's delays
// METHOD   residuals about the present line are gathered in blocks; a block gives one point: its median, or, where
//          delays are one-sided, its low quantile carried to the edge: q(a) - (q(2a) - q(a)) / (g - 1), g being the
//          growth of the quantiles there. A line with a prior on its
//          rate goes through the last 64 points by Huber weights. A pair far off the line is held back; eight that
//          agree are a step of the host clock or a restart of the device; where they may be late only, eight and a second
// SOURCE   own; chosen by simulation among minimum, low quantile, carried quantile and median (test_clock_fit.c)
#include <drv/clock_fit.h>

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum { FIRST_BLOCK = 32, BELIEVED = 8, ROUNDS = 6, KNOWN = 6 };
static const double block_s = 1.0;         // a block closes after this time with 32 pairs, …
static const double longest_block_s = 8.0; // … after this with any
static const double edge = 1.0 / 64;       // the low quantile
static const double abrupt = 0.5;          // jitters: what the first guess of the edge counts against the blocks
static const double huber = 2.0;           // in scatters
static const double longest_stall_s = 6.0; // a sender may be late by so much, …
static const double stall_lasts_s = 1.0;   // … but not by the same for this long
static const double rate_wander = 2e-6;    // by which a rate may have moved across a step

int drv_clock_fit_init(drv_clock_fit_t* self, const drv_clock_config_t* config) {
    memset(self, 0, sizeof *self);
    int bits = config->stamp_bits;
    if (!(config->tick_hz > 0) || bits < 8 || bits > 64 || ldexp(1, bits) < config->tick_hz ||
        !(config->jitter_s >= 0) || !(config->rate_ppm >= 0))
        return -EINVAL;
    self->config = *config;
    if (config->jitter_s == 0) self->config.jitter_s = 1e-3;
    if (config->rate_ppm == 0) self->config.rate_ppm = 200;
    self->rate_prior_sigma = 1e-6 * self->config.rate_ppm;
    self->growth_first = abrupt; // until the blocks tell
    self->growth_second = 2 * abrupt;
    return 0;
}

static double line_at(const drv_clock_fit_t* self, double device_s) {
    return self->line + self->rate * (device_s - self->since);
}

static double sigma_at(const drv_clock_fit_t* self, double device_s) {
    double d = device_s - self->since;
    double v = self->variance[0] + 2 * d * self->variance[1] + d * d * self->variance[2];
    return sqrt(v > 0 ? v : 0);
}

static double seconds_of(const drv_clock_fit_t* self, int64_t ticks) {
    return (double)(ticks - self->device0) / self->config.tick_hz;
}

/// The stamp unwrapped to lie nearest to `about` (ticks).
static int64_t unwrap(const drv_clock_fit_t* self, uint64_t stamp, int64_t about) {
    int spare = 64 - self->config.stamp_bits;
    uint64_t apart = (stamp - (uint64_t)about) << spare;
    return about + ((int64_t)apart >> spare);
}

static int order(const void* a, const void* b) {
    double x = *(const double*)a, y = *(const double*)b;
    return (x > y) - (x < y);
}

static double quantile(const double* sorted, int32_t count, double fraction) {
    double at = fraction * count - 0.5;
    if (at <= 0) return sorted[0];
    if (at >= count - 1) return sorted[count - 1];
    int32_t low = (int32_t)at;
    return sorted[low] + (at - low) * (sorted[low + 1] - sorted[low]);
}

static double median(double* values, int32_t count) {
    qsort(values, (size_t)count, sizeof *values, order);
    return quantile(values, count, 0.5);
}

/// Near the edge quantiles grow with a power of their fraction: by 2 from one doubling to the next where delays begin
/// abruptly (exponential), by sqrt(2) where short ones are rare. A block tells it badly, all of them well.
static void learn_growth(drv_clock_fit_t* self, double first, double second) {
    self->growth_first += fmax(first, 0) / self->config.jitter_s;
    self->growth_second += fmax(second, 0) / self->config.jitter_s;
    self->growth = fmin(2, fmax(sqrt(2), self->growth_second / self->growth_first));
}

/// Where the block stands above the line. Arrivals that are early and alone are errors, not the least delay.
static double block_level(drv_clock_fit_t* self) {
    const double* sorted = self->block;
    int32_t count = self->block_count, most = count / 16;
    qsort(self->block, (size_t)count, sizeof self->block[0], order);
    if (self->config.jitter == DRV_CLOCK_SYMMETRIC) return quantile(sorted, count, 0.5);
    for (; most > 0 && sorted[2] - sorted[0] > self->config.jitter_s; --most) ++sorted, --count;
    const double low = quantile(sorted, count, edge), next = quantile(sorted, count, 2 * edge);
    learn_growth(self, next - low, quantile(sorted, count, 4 * edge) - next);
    return low - (next - low) / (self->growth - 1);
}

/// Sums of a weighted line fit about self->since, and its solution. σ of a point of weight 1 is `sigma`.
static void solve_line(drv_clock_fit_t* self, const double* weight, int32_t count, double sigma) {
    double s = 0, st = 0, stt = 0, sy = 0, sty = 0;
    for (int32_t i = 0; i < count; ++i) {
        double t = self->point_at[i] - self->since, w = weight[i];
        s += w, st += w * t, stt += w * t * t;
        sy += w * self->point[i], sty += w * t * self->point[i];
    }
    double prior = sigma / self->rate_prior_sigma;
    prior *= prior;
    stt += prior, sty += prior * self->rate_prior;
    double det = s * stt - st * st;
    self->line = (stt * sy - st * sty) / det;
    self->rate = (s * sty - st * sy) / det;
    self->variance[0] = sigma * sigma * stt / det;
    self->variance[1] = -sigma * sigma * st / det;
    self->variance[2] = sigma * sigma * s / det;
}

/// The line through the points by Huber weights, its scale from the median of what is left. It begins from the line as it
/// was: after a pause that one is uncertain where the new points lie, and so much they may be off it.
static void fit(drv_clock_fit_t* self) {
    double weight[DRV_CLOCK_BLOCKS], left[DRV_CLOCK_BLOCKS] = {0};
    int32_t count = self->points < DRV_CLOCK_BLOCKS ? (int32_t)self->points : DRV_CLOCK_BLOCKS;
    double least = 1e-9 + 0.1 / self->config.tick_hz;                  // a stamp is not finer than its tick
    if (count < KNOWN) least = fmax(least, self->config.jitter_s / 4); // few points tell no scatter
    // The median of what a line leaves of few points is too small (Rousseeuw and Leroy 1987, section 5.1).
    const double few = count < KNOWN ? 1 : 1 + 5.0 / (count - 2);
    double scatter = fmax(least, self->scatter);
    for (int round = 0; round < ROUNDS; ++round) {
        for (int32_t i = 0; i < count; ++i) {
            double at = self->point_at[i];
            double off = fabs(self->point[i] - line_at(self, at)) / hypot(scatter, sigma_at(self, at));
            weight[i] = off <= huber ? 1 : off <= 4 * huber ? huber / off : 1e-9;
        }
        self->since = self->point_at[(self->points - 1) % DRV_CLOCK_BLOCKS];
        solve_line(self, weight, count, scatter);
        for (int32_t i = 0; i < count; ++i) left[i] = fabs(self->point[i] - line_at(self, self->point_at[i]));
        scatter = fmax(least, 1.4826 * few * median(left, count));
    }
    self->scatter = scatter;
}

static void close_block(drv_clock_fit_t* self) {
    double at = self->block_sum / self->block_count;
    self->point_at[self->points % DRV_CLOCK_BLOCKS] = at;
    self->point[self->points % DRV_CLOCK_BLOCKS] = line_at(self, at) + block_level(self);
    ++self->points;
    self->block_count = 0;
    self->block_sum = 0;
    if (self->block_target < DRV_CLOCK_BLOCK) self->block_target *= 2;
    fit(self);
}

/// Everything but the rate starts again at this pair.
static void begin(drv_clock_fit_t* self, int64_t device, int64_t host_ns) {
    double sigma = self->points > 1 ? sqrt(self->variance[2]) : self->rate_prior_sigma;
    if (self->points > 1) {
        self->rate_prior = self->rate;
        self->rate_prior_sigma = fmin(hypot(sigma, rate_wander), 1e-6 * self->config.rate_ppm);
    }
    self->host0_ns = host_ns;
    self->device0 = self->last_device = device;
    self->line = self->since = 0;
    self->rate = self->rate_prior;
    self->variance[0] = 400 * self->config.jitter_s * self->config.jitter_s;
    self->variance[1] = 0;
    self->variance[2] = self->rate_prior_sigma * self->rate_prior_sigma;
    self->scatter = 0;
    self->points = 0;
    self->block_count = self->suspects = 0;
    self->block_sum = 0;
    self->block_target = FIRST_BLOCK;
    self->started = 1;
}

static void gather(drv_clock_fit_t* self, int64_t device, double device_s, double residual) {
    if (self->block_count == 0) self->block_first = device_s;
    self->block[self->block_count++] = residual;
    self->block_sum += device_s;
    self->last_device = device;
    self->suspects = 0;
    ++self->used;
    double span = device_s - self->block_first;
    if (self->block_count >= self->block_target || (self->block_count >= FIRST_BLOCK && span >= block_s) ||
        (self->points > 0 && span >= longest_block_s))
        close_block(self);
}

/// A pair far off: with the stamp counted on from the last valid pair, does it agree with those before it?
static drv_clock_verdict_t suspect(drv_clock_fit_t* self, uint64_t stamp, int64_t host_ns, double gate) {
    int64_t about = self->suspects ? self->suspect_device : self->last_device;
    int64_t device = unwrap(self, stamp, about);
    double device_s = seconds_of(self, device), host_s = 1e-9 * (double)(host_ns - self->host0_ns);
    double off = host_s - device_s - line_at(self, device_s);
    ++self->outliers;
    if (self->suspects == 0 || fabs(off - self->suspect) > gate) {
        device = unwrap(self, stamp, self->last_device);
        device_s = seconds_of(self, device);
        double step = (double)(device - self->last_device) / self->config.tick_hz;
        self->suspect = host_s - device_s - line_at(self, device_s);
        self->suspect_is_restart = step < -0.1 || step > 2; // stamps may come a little out of order
        self->suspects = 0;
        self->suspect_since_s = device_s;
    }
    self->suspect_device = device;
    const int maybe_late = self->config.jitter == DRV_CLOCK_LATE && !self->suspect_is_restart && self->points > 0 &&
                           self->suspect > 0 && self->suspect < longest_stall_s;
    if (++self->suspects < BELIEVED) return DRV_CLOCK_OUTLIER;
    if (maybe_late && device_s - self->suspect_since_s < stall_lasts_s) return DRV_CLOCK_OUTLIER;
    int known = self->points > 0; // without a line it was the first pair that was wrong
    begin(self, device, host_ns);
    if (!known) return DRV_CLOCK_USED;
    ++*(self->suspect_is_restart ? &self->restarts : &self->host_steps);
    return self->suspect_is_restart ? DRV_CLOCK_RESTART : DRV_CLOCK_HOST_STEP;
}

drv_clock_verdict_t drv_clock_fit_add(drv_clock_fit_t* self, uint64_t stamp, int64_t host_ns) {
    if (!self->started) begin(self, unwrap(self, stamp, 0), host_ns);
    double host_s = 1e-9 * (double)(host_ns - self->host0_ns);
    // The device time that the line gives to this host time; before there is a line, clocks run alike.
    double about_s = (host_s - self->line + self->rate * self->since) / (1 + self->rate);
    int64_t about = self->device0 + llround(about_s * self->config.tick_hz);
    int64_t device = unwrap(self, stamp, about);
    double device_s = seconds_of(self, device), residual = host_s - device_s - line_at(self, device_s);
    double since_good = fabs(device_s - seconds_of(self, self->last_device));
    double gate = 20 * self->config.jitter_s + 1 / self->config.tick_hz;
    double reach = self->points > 1 ? 5 * sigma_at(self, device_s) : 1e-6 * self->config.rate_ppm * fabs(device_s);
    if (fabs(residual) > gate + reach + rate_wander * since_good) return suspect(self, stamp, host_ns, gate);
    gather(self, device, device_s, residual);
    return DRV_CLOCK_USED;
}

int drv_clock_fit_map(const drv_clock_fit_t* self, uint64_t stamp, int64_t* host_ns, double* sigma_s) {
    if (self->points == 0) return -EAGAIN;
    int64_t device = unwrap(self, stamp, self->last_device);
    double device_s = seconds_of(self, device);
    // The whole seconds apart: a double of seconds keeps nanoseconds for 100 days only.
    int64_t ticks = device - self->device0;
    int64_t hz = (int64_t)self->config.tick_hz;
    int64_t device_ns = self->config.tick_hz == (double)hz
                            ? ticks / hz * 1000000000 + llround((double)(ticks % hz) * 1e9 / self->config.tick_hz)
                            : llround(device_s * 1e9);
    *host_ns = self->host0_ns + device_ns + llround(1e9 * line_at(self, device_s));
    if (sigma_s) *sigma_s = sigma_at(self, device_s);
    return 0;
}

int drv_clock_fit_rate(const drv_clock_fit_t* self, double* ppm, double* sigma_ppm) {
    if (self->points == 0) return -EAGAIN;
    *ppm = 1e6 * self->rate;
    if (sigma_ppm) *sigma_ppm = 1e6 * sqrt(self->variance[2]);
    return 0;
}
