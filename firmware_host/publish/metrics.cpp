// SPDX-License-Identifier: MIT
#include "metrics.hpp"

#include "error.hpp"
#include "http_page.hpp"

#include <fmt/format.h>

#ifdef OKID_PROMETHEUS
#include <cmath>
#include <cstdio>
#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>
#include <unistd.h>
#endif

namespace okid_host {

#ifndef OKID_PROMETHEUS
std::unique_ptr<event_sink> make_metrics(const net_address&, std::function<publisher_figures()>) {
    throw failure(exit_usage, "[publish] prometheus: this okid was built without prometheus-cpp-dev");
}
#else
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using labels = std::vector<ClientMetric::Label>;

class page {
  public:
    MetricFamily& family(const char* name, const char* help, MetricType type) {
        MetricFamily& out = families.emplace_back();
        out.name = name;
        out.help = help;
        out.type = type;
        return out;
    }
    static void add(MetricFamily& to, labels which, double value) {
        if (!std::isfinite(value)) return;
        ClientMetric& one = to.metric.emplace_back();
        one.label = std::move(which);
        (to.type == MetricType::Counter ? one.counter.value : one.gauge.value) = value;
    }
    void gauge(const char* name, const char* help, double value) {
        add(family(name, help, MetricType::Gauge), {}, value);
    }
    void counter(const char* name, const char* help, std::uint64_t value) {
        add(family(name, help, MetricType::Counter), {}, static_cast<double>(value));
    }
    std::vector<MetricFamily> families;
};

double resident_bytes() {
    long pages = 0, resident = 0;
    if (std::FILE* file = std::fopen("/proc/self/statm", "re")) {
        if (std::fscanf(file, "%ld %ld", &pages, &resident) != 2) resident = 0;
        std::fclose(file);
    }
    return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

void add_buses(page& to, const live_numbers& now) {
    MetricFamily& received = to.family("okid_frames_received_total", "Frames that came in", MetricType::Counter);
    for (const auto& [name, counts] : now.bus.items())
        page::add(received, {{"bus", name}}, number_of(counts, "received"));
    MetricFamily& lost = to.family("okid_frames_lost_total", "Frames lost, by cause", MetricType::Counter);
    for (const auto& [name, counts] : now.bus.items())
        for (const auto& [cause, count] : counts.at("lost_by").items())
            page::add(lost, {{"bus", name}, {"cause", cause}}, count.is_number() ? count.get<double>() : NAN);
    MetricFamily& whole =
        to.family("okid_channel_completeness_percent", "Samples received of those expected", MetricType::Gauge);
    for (const auto& [name, counts] : now.channel.items())
        page::add(whole, {{"channel", name}}, number_of(counts, "completeness_percent"));
}

void add_modes(page& to, const live_numbers& now) {
    const auto add = [&](const char* name, const char* help, double live_numbers::mode::* value) {
        MetricFamily& family = to.family(name, help, MetricType::Gauge);
        for (const live_numbers::mode& each : now.modes)
            page::add(family, {{"mode", std::to_string(each.track)}}, each.*value);
    };
    add("okid_mode_frequency_hz", "Natural frequency of a tracked mode", &live_numbers::mode::frequency_hz);
    add("okid_mode_frequency_std_hz", "Its standard deviation", &live_numbers::mode::frequency_std_hz);
    add("okid_mode_damping_ratio", "Damping ratio of a tracked mode", &live_numbers::mode::damping_ratio);
    add("okid_mode_damping_ratio_std", "Its standard deviation", &live_numbers::mode::damping_ratio_std);
}

std::vector<MetricFamily> collect(const live_numbers& now, const publisher_figures& figures) {
    page out;
    out.gauge("okid_stream_seconds", "Stream time of the newest modes", now.t);
    out.gauge("okid_settled", "1 = the modal table has settled", now.settled);
    out.gauge("okid_alarm", "1 = a tracked mode is away from its baseline", now.alarm);
    out.counter("okid_alarms_total", "Alarms raised", now.alarms);
    out.counter("okid_changes_total", "Changes of the structure that restarted the identification", now.changes);
    out.counter("okid_gaps_total", "Gaps in the samples", now.gaps);
    out.counter("okid_updates_total", "Updates computed", figures.updates);
    out.counter("okid_updates_skipped_total", "Updates left out because the machine was too slow", figures.skipped);
    out.gauge("okid_update_seconds", "How long the newest update took to compute", figures.update_s);
    out.gauge("okid_update_worst_seconds", "How long the longest update took", figures.update_worst_s);
    out.counter("okid_events_dropped_total", "Events that publishing was too slow for", figures.dropped);
    out.gauge("okid_resident_bytes", "Resident memory of okid", resident_bytes());
    add_buses(out, now);
    add_modes(out, now);
    return std::move(out.families);
}

class metrics : public event_sink {
  public:
    metrics(const net_address& at, std::function<publisher_figures()> figures)
        : figures_(std::move(figures)), page_("[publish] prometheus", at, "/metrics",
                                              "text/plain; version=0.0.4; charset=utf-8", [this] { return text(); }) {}
    void take(const publication& one) override { numbers_.take(one); }
    void add_polls(std::vector<pollfd>& polls) const override { page_.add_polls(polls); }
    void tick() override { page_.serve(); }

  private:
    std::string text() const { return prometheus::TextSerializer().Serialize(collect(numbers_, figures_())); }

    std::function<publisher_figures()> figures_;
    live_numbers numbers_;
    http_page page_;
};

} // namespace

std::unique_ptr<event_sink> make_metrics(const net_address& at, std::function<publisher_figures()> figures) {
    return std::make_unique<metrics>(at, std::move(figures));
}
#endif

} // namespace okid_host
