// SPDX-License-Identifier: MIT
// All methods at one size take turns, so that what disturbs the machine disturbs all of them; memory is taken before.
// Times are those of the thread's own clock: what other programs take of the processor is not in them.
#include "bench_identify.hpp"

#include "files/order_statistics.hpp"
#include <algorithm>
#include <cmath>
#include <ctime>
#include <fmt/format.h>
#include <limits>
#include <okid/okid.h>
#include <okid/steps/square_root.h>
#include <okid/steps/subspace.h>

namespace okid_host {
namespace {

// The first three are those of comparisons between programs, the others okid's own: long horizons, short records.
constexpr bench_size sizes[] = {{0, 10000, 10, 20}, {1, 20000, 15, 30}, {2, 100000, 22, 44},
                                {0, 10000, 40, 80}, {1, 10000, 30, 60}, {2, 10000, 25, 50}};

struct method_name {
    okid_method_t method;
    const char* name;
};
constexpr method_name methods[] = {{OKID_METHOD_OKID_ERA, "okid-era"},
                                   {OKID_METHOD_OKID_ERA_DC, "okid-era-dc"},
                                   {OKID_METHOD_N4SID_MOESP, "n4sid-moesp"},
                                   {OKID_METHOD_N4SID_CVA, "n4sid-cva"},
                                   {OKID_METHOD_N4SID_SSARX, "n4sid-ssarx"}};

enum class input { doubles, codes, doubles_qr };

class okid_contender : public bench_contender {
  public:
    okid_contender(const bench_record& record, const bench_size& size, const method_name& how, input from,
                   bool output_error)
        : record_(record), from_(from), output_error_(output_error) {
        const bool observer = how.method <= OKID_METHOD_OKID_ERA_DC;
        okid_identify_config_t config{};
        config.n_u = record.n_u;
        config.n_y = record.n_y;
        config.p = size.block_rows;
        config.rows = observer ? size.era_rows : size.block_rows;
        config.order = config.max_order = record.order;
        config.fs_hz = record.rate_hz;
        config.method = how.method;
        kernel = how.name;
        if (output_error) kernel += "+output-error";
        sample = from == input::codes ? "int16" : "double";
        identify_memory_.resize(okid_identify_memsize(&config));
        ready_ = okid_identify_create(&identify_, &config, identify_memory_.data(), identify_memory_.size()) == OKID_OK;
        create_kernel(okid_identify_lags(&config));
        if (output_error) work_.resize(okid_subspace_output_error_memsize(record.n_u, record.n_y, record.order, 1));
        B_.resize(static_cast<std::size_t>(record.order * record.n_u));
        D_.resize(static_cast<std::size_t>(record.n_y * record.n_u));
    }

    bool run() override {
        if (!ready_) return false;
        const double begin = bench_seconds();
        absorb();
        const double absorbed = bench_seconds();
        bool good = (from_ == input::doubles_qr ? okid_identify_run_factor(identify_, square_root_, &found_)
                                                : okid_identify_run(identify_, accumulator_, &found_)) >= 0;
        const double end = bench_seconds();
        good = good && (!output_error_ || fit_inputs());
        seconds.push_back(bench_seconds() - begin);
        update.push_back(end - absorbed);
        if (good) error = compare_modes(record_.truth, found_.frequency_hz, found_.damping_ratio, found_.mode_count);
        return good;
    }

  private:
    void create_kernel(int lags) {
        if (from_ == input::doubles_qr) {
            const okid_square_root_config_t config{record_.n_u, record_.n_y, lags, 256, 0, 0, 0, 1};
            kernel_memory_.resize(okid_square_root_memsize(&config));
            ready_ = ready_ && okid_square_root_create(&square_root_, &config, kernel_memory_.data(),
                                                       kernel_memory_.size()) == OKID_OK;
            kernel += "+qr";
            return;
        }
        okid_accumulator_config_t config{};
        config.n_u = record_.n_u;
        config.n_y = record_.n_y;
        config.lags = lags;
        config.sample = from_ == input::codes ? OKID_SAMPLE_INT16 : OKID_SAMPLE_DOUBLE;
        config.forgetting = 1;
        config.bulk = from_ == input::codes;
        kernel_memory_.resize(okid_accumulator_memsize(&config));
        ready_ = ready_ && okid_accumulator_create(&accumulator_, &config, kernel_memory_.data(),
                                                   kernel_memory_.size()) == OKID_OK;
        if (ready_ && from_ == input::codes) okid_accumulator_set_units(accumulator_, record_.scale.data(), nullptr);
    }

    void absorb() {
        const auto count = static_cast<std::size_t>(record_.samples);
        okid_status_t status;
        if (from_ == input::doubles_qr) {
            okid_square_root_reset(square_root_);
            status = okid_square_root_add(square_root_, record_.v.data(), count);
        } else {
            okid_accumulator_reset(accumulator_);
            status = from_ == input::codes ? okid_accumulator_add_i16(accumulator_, record_.codes.data(), count)
                                           : okid_accumulator_add(accumulator_, record_.v.data(), count);
        }
        ready_ = ready_ && status >= 0;
    }

    bool fit_inputs() {
        const std::int32_t count = record_.samples;
        const okid_model_t model{record_.n_u, record_.n_y, found_.n_z, found_.A, nullptr, found_.C, nullptr, nullptr};
        const okid_records_t records{1, &count, record_.v.data()};
        return okid_subspace_output_error(&model, &records, B_.data(), D_.data(), nullptr, work_.data(),
                                          work_.size()) == OKID_OK &&
               okid_identify_set_inputs(identify_, B_.data(), D_.data(), &found_) == OKID_OK;
    }

    const bench_record& record_;
    const input from_;
    const bool output_error_;
    bool ready_ = false;
    std::vector<char> identify_memory_, kernel_memory_, work_;
    std::vector<double> B_, D_;
    okid_identify_t* identify_ = nullptr;
    okid_accumulator_t* accumulator_ = nullptr;
    okid_square_root_t* square_root_ = nullptr;
    okid_identified_t found_{};
};

/// Noise-free records have a singular Gram matrix: they go by QR of the data.
bench_contenders enter(const bench_record& record, const bench_size& size, bool noise_free) {
    bench_contenders all;
    const auto okid = [&](const method_name& how, input from, bool output_error = false) {
        all.push_back(std::make_unique<okid_contender>(record, size, how, from, output_error));
    };
    for (const method_name& how : methods) okid(how, noise_free ? input::doubles_qr : input::doubles);
    if (!noise_free) {
        okid(methods[2], input::codes);
        okid(methods[2], input::doubles, true);
    }
    return all;
}

void take_turns(bench_contenders& all, int least, int most, double budget) {
    const double begin = bench_seconds();
    for (int round = 0; round < most && (round < least || bench_seconds() - begin < budget); ++round)
        for (const auto& each : all)
            if (!each->run()) {
                each->seconds.clear();
                each->update.clear();
            }
}

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

double smallest(const std::vector<double>& v) { return v.empty() ? nothing : *std::min_element(v.begin(), v.end()); }

nlohmann::ordered_json describe(const bench_size& size, double noise, const bench_contender& c) {
    return {{"name", "identify"},
            {"case", bench_structures()[static_cast<std::size_t>(size.structure)].name},
            {"p", size.block_rows},
            {"samples", size.samples},
            {"noise_percent", noise},
            {"kernel", c.kernel},
            {"sample", c.sample},
            {"seconds", smallest(c.seconds)},
            {"seconds_median", median(c.seconds)},
            {"seconds_update", smallest(c.update)},
            {"frequency_error", c.error.frequency},
            {"damping_error", c.error.damping}};
}

std::string cell(const nlohmann::ordered_json& value, double unit) {
    return value.is_number() && std::isfinite(value.get<double>()) ? fmt::format("{:10.3g}", value.get<double>() * unit)
                                                                   : fmt::format("{:>10}", "-");
}

} // namespace

double bench_seconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void bench_identifications(nlohmann::ordered_json& rows, const bench_entrants& others) {
    for (const bench_size& size : sizes)
        for (const double noise : {1.0, 5.0, 0.0}) {
            const bench_structure& from = bench_structures()[static_cast<std::size_t>(size.structure)];
            const bench_record record = make_record(from, size.samples, noise);
            bench_contenders all = enter(record, size, noise == 0);
            if (others) others(record, size, all);
            if (noise == 1)
                take_turns(all, 5, 25, 2);
            else
                take_turns(all, 1, 1, 0);
            for (const auto& each : all) rows.push_back(describe(size, noise, *each));
        }
}

void print_identifications(const nlohmann::ordered_json& rows) {
    const auto identifies = [](const nlohmann::ordered_json& r) { return r["name"] == "identify"; };
    if (std::none_of(rows.begin(), rows.end(), identifies)) return;
    fmt::print(
        "\nwhole identifications, samples in memory to A, B, C, D, K and modes (least of the runs, thread time; "
        "update: the model from the sums)\n{:4} {:>3} {:>7} {:>5}  {:26} {:6} {:>10} {:>10} {:>10} {:>10} {:>10}\n",
        "case", "s", "samples", "noise", "method", "sample", "ms", "median ms", "update ms", "f error", "zeta error");
    for (const nlohmann::ordered_json& r : rows) {
        if (!identifies(r)) continue;
        const auto kernel = r["kernel"].get<std::string>();
        fmt::print("{:4} {:3} {:7} {:4g}%  {:26} {:6} {} {} {} {} {}\n", r["case"].get<std::string>(),
                   r["p"].get<int>(), r["samples"].get<int>(), r["noise_percent"].get<double>(), kernel,
                   r["sample"].get<std::string>(), cell(r["seconds"], 1e3), cell(r["seconds_median"], 1e3),
                   cell(r["seconds_update"], 1e3), cell(r["frequency_error"], 1), cell(r["damping_error"], 1));
    }
}

} // namespace okid_host
