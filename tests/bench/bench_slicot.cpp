// SPDX-License-Identifier: MIT
// PURPOSE  whole identifications of okid and of SLICOT on the same records, in turns within one process
// METHOD   the contenders of okid bench, and two more a record; rows and ratios go into the file of `okid bench --save`
// USAGE    bench_slicot BENCH.json
#include "commands/bench_identify.hpp"
#include "slicot.hpp"

#include <cblas.h>
#include <fmt/format.h>
#include <fstream>
#include <okid/modal.h>

namespace {

using namespace okid_host;

class slicot_contender : public bench_contender {
  public:
    slicot_contender(const bench_record& record, std::shared_ptr<slicot> library, slicot_method method,
                     slicot_factor factor)
        : record_(record), library_(std::move(library)), method_(method), factor_(factor),
          work_(okid_modal_memsize(record.n_y, record.order)) {
        kernel = fmt::format("slicot-{}{}", method == slicot_method::moesp ? "moesp" : "n4sid",
                             factor == slicot_factor::qr ? "+qr" : "");
        for (auto* each : {&frequency_, &damping_}) each->resize(static_cast<std::size_t>(record.order / 2));
    }

    bool run() override {
        const double begin = bench_seconds();
        if (!library_->run(method_, factor_)) return false;
        const okid_model_t model{record_.n_u, record_.n_y,   record_.order, library_->A(),
                                 nullptr,     library_->C(), nullptr,       nullptr};
        okid_modes_t modes{};
        modes.frequency_hz = frequency_.data();
        modes.damping_ratio = damping_.data();
        const okid_status_t status =
            okid_modal_analyse(&model, 1 / record_.rate_hz, &modes, work_.data(), work_.size());
        seconds.push_back(bench_seconds() - begin);
        if (status >= 0) error = compare_modes(record_.truth, frequency_.data(), damping_.data(), modes.count);
        return status >= 0;
    }

  private:
    const bench_record& record_;
    std::shared_ptr<slicot> library_; ///< one workspace for all of a size
    const slicot_method method_;
    const slicot_factor factor_;
    std::vector<char> work_;
    std::vector<double> frequency_, damping_;
};

/// Noise-free records have a singular Gram matrix: QR of the data there, as okid.
void enter_slicot(const bench_record& record, const bench_size& size, bench_contenders& all) {
    const std::shared_ptr<slicot> library = slicot::load(record, size.block_rows);
    const bool noise_free = all.front()->kernel.find("+qr") != std::string::npos;
    for (const slicot_method method : {slicot_method::moesp, slicot_method::n4sid})
        all.push_back(std::make_unique<slicot_contender>(record, library, method,
                                                         noise_free ? slicot_factor::qr : slicot_factor::cholesky));
}

/// How many times longer SLICOT's MOESP takes at 1 % noise.
void add_ratios(const nlohmann::ordered_json& rows, nlohmann::ordered_json& ratios) {
    const auto size_of = [](const nlohmann::ordered_json& r) {
        return fmt::format("{}_s{}", r["case"].get<std::string>(), r["p"].get<int>());
    };
    for (const auto& reference : rows)
        for (const auto& row : rows) {
            const auto kernel = row["kernel"].get<std::string>();
            if (reference["kernel"] != "slicot-moesp" || reference["noise_percent"] != 1.0 ||
                row["noise_percent"] != 1.0 || size_of(row) != size_of(reference) || kernel.find("slicot") == 0)
                continue;
            ratios[fmt::format("slicot_moesp_over_{}{}_{}", kernel, row["sample"] == "int16" ? "_i16" : "",
                               size_of(row))] = reference["seconds"].get<double>() / row["seconds"].get<double>();
        }
}

} // namespace

int main(int argc, char** argv) {
    if (argc != 2) {
        fmt::print(stderr, "usage: bench_slicot BENCH.json   (of okid bench --save)\n");
        return 2;
    }
    if (!slicot::load(make_record(bench_structures()[0], 1000, 1), 10)) {
        fmt::print("SLICOT is not installed (Debian package libslicot0): nothing to compare with\n");
        return 0;
    }
    openblas_set_num_threads(1);
    nlohmann::ordered_json bench, rows = nlohmann::ordered_json::array();
    std::ifstream(argv[1]) >> bench;
    bench_identifications(rows, enter_slicot);
    print_identifications(rows);
    add_ratios(rows, bench["ratios"]);
    auto& kept = bench["rows"];
    for (std::size_t k = kept.size(); k-- > 0;)
        if (kept[k]["name"] == "identify") kept.erase(k);
    for (const auto& row : rows) kept.push_back(row);
    std::ofstream(argv[1]) << bench.dump(1) << "\n";
    return 0;
}
