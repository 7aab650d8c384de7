// SPDX-License-Identifier: MIT
#include "hit_verdict.hpp"

#include "files/order_statistics.hpp"
#include <algorithm>
#include <complex>
#include <fmt/format.h>
#include <map>

namespace okid_host {
namespace {

constexpr double pulse_share = 0.1;  // of the peak: what belongs to a pulse
constexpr double hit_lasts = 0.05;   // of the peak: the force still acts
constexpr double beyond_noise = 5;   // deviations of the force that noise does not reach
constexpr double least_peak = 20;    // in deviations of the force before the hit
constexpr double most_motion = 0.1;  // rms before the hit, of that after it
constexpr double hardly_moves = 0.2; // of the rms of the sensor of its unit that moves most: noise is seen there
constexpr double band_share = 0.1;   // of the greatest amplitude: -20 dB
constexpr std::size_t hit_lines = 128;
constexpr std::size_t flat_top = 3; // samples that are exactly equal at an extreme: an amplifier at its limit,
constexpr double flat_ratio = 3;    // … if they are so many times those just beside it,
constexpr double flat_steps = 10;   // … within so many steps of the numbers. A smooth top of three has two within three
constexpr double still_rings = 0.01;     // of the largest amplitude, at the end,
constexpr double over_silence = 3;       // … and of that before the hit
constexpr std::size_t ring_parts = 16;   // of what follows a hit, for its amplitude
constexpr double one_hit = 0.25;         // of the longest time between hits: pulses closer are a hit and its double
constexpr double longest_pulse = 0.1;    // of the time to the next hit
constexpr std::size_t silence_parts = 8; // of the time since the hit before, that are kept before a hit

/// The judgement of one hit.
class hit_judge {
  public:
    explicit hit_judge(const hit_window& hit) : hit_(hit), channels_(*hit.channels) {}

    hit_verdict verdict() {
        if (!(too_early() || find_missing())) {
            measure();
            find_band();
            (void)(find_overload() || find_weak() || find_second_hit() || find_motion() || find_late() ||
                   find_narrow());
        }
        if (out_.good()) {
            out_.text = fmt::format("accepted: {:.4g}{}, {:.2f} ms, force up to {:.4g} Hz", out_.peak, hit_.unit,
                                    1e3 * out_.duration_s, out_.band_hz);
            remark_cut_off();
        }
        return std::move(out_);
    }

  private:
    bool refuse(const char* fault, std::string text) {
        out_.fault = fault;
        out_.text = std::move(text);
        return true;
    }

    bool too_early() {
        return hit_.before < hit_.fewest_before &&
               refuse("too_early", fmt::format("{} quiet samples stand before it, {} are needed: record earlier",
                                               hit_.before, hit_.fewest_before));
    }

    /// A sample that is missing in the middle of a hit cannot be asked for again, but the hit can.
    bool find_missing() {
        std::size_t lost = 0;
        for (std::size_t i = 0; i < hit_.count; ++i) {
            bool any = false;
            for (std::size_t c = 0; c < channels_.size(); ++c)
                any = any || (channels_[c].complete && std::isnan(hit_.at(i)[c]));
            lost += any;
        }
        return lost > 0 && refuse("samples_lost", fmt::format("{} of {} samples are missing", lost, hit_.count));
    }

    /// Peak and extent of the hit, and the noise of the force before it.
    void measure() {
        const std::size_t quiet = hit_.before * 7 / 8;
        double sum = 0, squares = 0;
        for (std::size_t i = 0; i < quiet; ++i) sum += hit_.force(i);
        base_ = sum / static_cast<double>(quiet);
        for (std::size_t i = 0; i < quiet; ++i) squares += (hit_.force(i) - base_) * (hit_.force(i) - base_);
        noise_ = std::sqrt(squares / static_cast<double>(quiet));
        top_ = hit_.before;
        for (std::size_t i = top_; i < hit_.count; ++i)
            if (hit_.sign * hit_.force(i) > hit_.sign * hit_.force(top_)) top_ = i;
        out_.peak = hit_.force(top_) - base_;
        begin_ = top_;
        end_ = top_ + 1;
        while (begin_ > 0 && share(begin_ - 1) > pulse_share) --begin_;
        while (end_ < hit_.count && share(end_) > pulse_share) ++end_;
        out_.duration_s = static_cast<double>(end_ - begin_) / hit_.rate_hz;
    }

    /// Of the peak.
    double share(std::size_t i) const { return (hit_.force(i) - base_) / out_.peak; }

    /// Where the spectrum of the pulse has fallen to a tenth of its greatest amplitude.
    void find_band() {
        const std::size_t margin = 2 + (end_ - begin_) / 2;
        const std::size_t first = begin_ > margin ? begin_ - margin : 0, last = std::min(hit_.count, end_ + margin);
        double greatest = 0;
        out_.band_hz = hit_.rate_hz / 2;
        for (std::size_t k = 0; k <= hit_lines; ++k) {
            const double f = static_cast<double>(k) / (2.0 * hit_lines); // of the rate
            std::complex<double> sum = 0;
            for (std::size_t i = first; i < last; ++i)
                sum += (hit_.force(i) - base_) * std::polar(1.0, -2 * M_PI * f * static_cast<double>(i - first));
            greatest = std::max(greatest, std::abs(sum));
            if (std::abs(sum) >= band_share * greatest) continue;
            out_.band_hz = f * hit_.rate_hz;
            return;
        }
    }

    bool find_full_scale(std::size_t c) {
        std::size_t full = 0;
        for (std::size_t i = 0; i < hit_.count; ++i)
            full += hit_.at(i)[c] >= channels_[c].high || hit_.at(i)[c] <= channels_[c].low;
        return full > 0 &&
               refuse("overload", fmt::format("{} stood at full scale for {} sample{}: strike softer or lower its gain",
                                              channels_[c].name, full, full == 1 ? "" : "s"));
    }

    /// Samples of a channel that are exactly its largest (or least) number, where hardly any are just beside it.
    std::size_t flat(std::size_t c, double sign) const {
        double extreme = -INFINITY, step = INFINITY, last = NAN;
        for (std::size_t i = hit_.before; i < hit_.count; ++i) {
            const double x = sign * hit_.at(i)[c];
            if (std::isnan(x)) continue;
            extreme = std::max(extreme, x);
            if (x != last && !std::isnan(last)) step = std::min(step, std::abs(x - last));
            last = x;
        }
        std::size_t at = 0, beside = 0;
        for (std::size_t i = hit_.before; i < hit_.count; ++i) {
            const double x = sign * hit_.at(i)[c];
            at += x == extreme;
            beside += x < extreme && x >= extreme - flat_steps * step;
        }
        return at >= flat_top && static_cast<double>(at) > flat_ratio * static_cast<double>(beside) ? at : 0;
    }

    bool find_overload() {
        for (std::size_t c = 0; c < channels_.size(); ++c) {
            if (find_full_scale(c)) return true;
            const bool hammer = c == hit_.hammer;
            for (const double sign : {1.0, -1.0}) {
                if (hammer && sign * hit_.scale * hit_.sign < 0) continue; // only its peak
                if (const std::size_t equal = flat(c, sign); equal > 0)
                    return refuse("overload", fmt::format("{} has a flat top, {} samples at its extreme: its amplifier "
                                                          "was at its limit",
                                                          channels_[c].name, equal));
            }
        }
        return false;
    }

    bool find_weak() {
        return !(std::abs(out_.peak) > least_peak * noise_) &&
               refuse("weak", fmt::format("a peak of {:.4g}{} is only {:.1f} times the noise of the force", out_.peak,
                                          hit_.unit, std::abs(out_.peak) / noise_));
    }

    bool find_second_hit() {
        const std::size_t apart = std::max<std::size_t>(3, (end_ - begin_) / 2);
        const double least = std::max(hit_.double_percent / 100, beyond_noise * noise_ / std::abs(out_.peak));
        for (std::size_t i = hit_.before * 7 / 8; i < hit_.count; ++i) {
            if (i + apart >= begin_ && i < end_ + apart) continue;
            if (share(i) > least)
                return refuse(
                    "double_hit",
                    fmt::format("a second hit of {:.0f} % {:.1f} ms {}", 100 * share(i),
                                1e3 * std::abs(static_cast<double>(i) - static_cast<double>(top_)) / hit_.rate_hz,
                                i > top_ ? "later" : "earlier"));
        }
        return false;
    }

    double rms(std::size_t c, std::size_t first, std::size_t last) const {
        double sum = 0, squares = 0, n = 0;
        for (std::size_t i = first; i < last; ++i)
            if (const double x = hit_.at(i)[c]; !std::isnan(x)) sum += x, squares += x * x, ++n;
        const double mean = sum / n;
        return std::sqrt(std::max(0.0, squares / n - mean * mean));
    }

    /// Is the structure still ringing from what was before? The rms before the hit against that behind it. A sensor that hardly
    /// moves shows its noise: there it is a share of what the sensor of the same unit shows that moves most.
    bool find_motion() {
        const std::size_t quiet = hit_.before * 7 / 8, end = std::min(hit_.count, 2 * hit_.before);
        const auto moved = [&](std::size_t c) { return channels_[c].scale * rms(c, hit_.before, end); };
        std::map<std::string, double> most;
        for (std::size_t c = 0; c < channels_.size(); ++c)
            if (!channels_[c].force) most[channels_[c].unit] = std::fmax(most[channels_[c].unit], moved(c));
        for (std::size_t c = 0; c < channels_.size(); ++c) {
            if (channels_[c].force) continue;
            const double share =
                channels_[c].scale * rms(c, 0, quiet) / std::fmax(moved(c), hardly_moves * most[channels_[c].unit]);
            if (share > most_motion)
                return refuse("moving",
                              fmt::format("{} still moved before the hit, by {:.0f} % of what the hit caused (rms): "
                                          "wait longer, or strike harder",
                                          channels_[c].name, 100 * share));
        }
        return false;
    }

    /// About the force before the hit: one that somebody leans on has another middle.
    bool find_late() {
        const double least = std::max(hit_lasts, beyond_noise * noise_ / std::abs(out_.peak));
        free_from_ = hit_.count;
        while (free_from_ > end_ && std::abs(share(free_from_ - 1)) <= least) --free_from_;
        const double free =
            static_cast<double>(hit_.count - free_from_) / static_cast<double>(hit_.count - hit_.before);
        return free < least_free &&
               refuse("late", fmt::format("the force ends late: {:.0f} % of what follows its beginning is free of it, "
                                          "{:.0f} % are needed",
                                          100 * free, 100 * least_free));
    }

    bool find_narrow() {
        return out_.band_hz < hit_.spectrum_hz &&
               refuse("spectrum", fmt::format("the force reaches to {:.4g} Hz only (-20 dB), wanted {:.4g} Hz: take a "
                                              "harder tip",
                                              out_.band_hz, hit_.spectrum_hz));
    }

    /// A ring-down that the end of the record cuts off costs nothing but length.
    void remark_cut_off() {
        const std::size_t first = free_from_, part = (hit_.count - first) / ring_parts;
        double most = 0;
        for (std::size_t c = 0; part > 1 && c < channels_.size(); ++c) {
            if (channels_[c].force) continue;
            double largest = 0;
            for (std::size_t k = 0; k < ring_parts; ++k)
                largest = std::fmax(largest, rms(c, first + k * part, first + (k + 1) * part));
            const double last = rms(c, hit_.count - part, hit_.count), left = last / largest;
            if (!(left > std::max(most, still_rings) && last > over_silence * rms(c, 0, hit_.before * 7 / 8))) continue;
            most = left;
            out_.note = fmt::format("ring-down cut off: {} ends at {:.0f} %", channels_[c].name, 100 * left);
        }
    }

    const hit_window& hit_;
    const std::vector<hit_channel>& channels_;
    double base_ = 0, noise_ = 0;
    std::size_t free_from_ = 0;                 ///< the force no longer acts
    std::size_t top_ = 0, begin_ = 0, end_ = 0; ///< rows of the peak, of the first and behind the last above 10 % of it
    hit_verdict out_;
};

} // namespace

hit_verdict judge_hit(const hit_window& hit) { return hit_judge(hit).verdict(); }

namespace {

/// The force of a record about its middle.
class force_shape {
  public:
    force_shape(const double* force, std::size_t count, std::size_t stride) : force_(force), stride_(stride) {
        std::vector<double> about;
        for (std::size_t i = 0; i < count; ++i)
            if (!std::isnan(force[i * stride])) about.push_back(force[i * stride]);
        if (about.empty()) return;
        base_ = upper_median(about);
        for (double& x : about) {
            if (std::abs(x - base_) > std::abs(peak_)) peak_ = x - base_;
            x = std::abs(x - base_);
        }
        noise_ = 1.4826 * upper_median(about);
    }

    double peak() const { return peak_; }
    bool any_hit() const { return std::abs(peak_) > least_peak * noise_; }
    bool is_peak(std::size_t i) const { return force_[i * stride_] - base_ == peak_; }
    bool beyond(std::size_t i, double share) const {
        return std::abs(force_[i * stride_] - base_) > std::max(share * std::abs(peak_), beyond_noise * noise_);
    }

  private:
    const double* force_;
    std::size_t stride_;
    double base_ = 0, noise_ = 0, peak_ = 0;
};

} // namespace

hit_span find_hit(const double* force, std::size_t count, std::size_t stride) {
    hit_span out;
    out.end = count;
    const force_shape shape(force, count, stride);
    if (shape.peak() == 0) return out;
    out.sign = shape.peak() < 0 ? -1 : 1;
    if (!shape.any_hit()) { // no hit to be seen: where it would be
        while (!shape.is_peak(out.begin)) ++out.begin;
        return out;
    }
    while (out.begin + 1 < count && !shape.beyond(out.begin, pulse_share)) ++out.begin;
    while (out.end > out.begin + 1 && !shape.beyond(out.end - 1, hit_lasts)) --out.end;
    out.free = static_cast<double>(count - out.end) / static_cast<double>(count - out.begin);
    return out;
}

std::vector<std::size_t> find_cuts(const double* force, std::size_t count, std::size_t stride) {
    struct pulse {
        std::size_t begin, end;
    };
    const force_shape shape(force, count, stride);
    if (!shape.any_hit()) return {};
    std::vector<pulse> pulses;
    for (std::size_t i = 0; i < count; ++i) {
        if (!shape.beyond(i, pulse_share)) continue;
        if (pulses.empty() || pulses.back().end < i) pulses.push_back({i, i});
        pulses.back().end = i + 1;
    }
    const auto apart = [&](std::size_t k) {
        return (k + 1 < pulses.size() ? pulses[k + 1].begin : count) - pulses[k].begin;
    };
    std::size_t longest = 0;
    for (std::size_t k = 0; k < pulses.size(); ++k) longest = std::max(longest, apart(k));
    std::vector<pulse> hits; // those soon after another belong to it
    for (std::size_t k = 0; k < pulses.size(); ++k) {
        if (hits.empty() ||
            static_cast<double>(pulses[k].begin - hits.back().begin) >= one_hit * static_cast<double>(longest))
            hits.push_back(pulses[k]);
        hits.back().end = pulses[k].end;
    }
    pulses = std::move(hits);
    std::vector<std::size_t> out;
    for (std::size_t k = 0; k < pulses.size(); ++k) {
        if (static_cast<double>(pulses[k].end - pulses[k].begin) > longest_pulse * static_cast<double>(apart(k)))
            return {};
        if (k > 0) out.push_back(pulses[k].begin - apart(k - 1) / silence_parts);
    }
    return out;
}

} // namespace okid_host
