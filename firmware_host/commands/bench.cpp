// SPDX-License-Identifier: MIT
// okid bench: what a sample costs in the recursive kernel, beside textbook RLS, the same product by OpenBLAS, and LAPACK
// least squares on the whole record; and what whole identifications cost (bench_identify.cpp). All in one
// run, one thread: the ratios count, not the times.
#include "bench_identify.hpp"
#include "blas_kernels.hpp"
#include "commands.hpp"
#include "files/whole_file.hpp"
#include "result/result.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cblas.h>
#include <chrono>
#include <fmt/core.h>
#include <functional>
#include <lapacke.h>
#include <okid/okid.h>
#include <okid/steps/square_root.h>
#include <random>
#include <vector>

extern "C" void openblas_set_num_threads(int);

namespace okid_host {
namespace {

struct bench_case {
    const char* name;
    int n_u, n_y;
};
constexpr bench_case cases[] = {{"W1", 1, 3}, {"W2", 2, 6}, {"W3", 3, 10}};
constexpr int horizons[] = {20, 40};

struct row {
    std::string name, kernel;
    int p;
    double ns_per_sample, gflops;
    std::size_t state_bytes; ///< what a sample is absorbed into, without buffers
};

/// Best of several rounds: the machine is shared, the fastest round is the one least disturbed.
double seconds_of(const std::function<void()>& work) {
    double best = 1e9, total = 0;
    for (int round = 0; round < 40 && (round < 3 || total < 0.25); ++round) {
        const auto begin = std::chrono::steady_clock::now();
        work();
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
        best = std::min(best, took.count());
        total += took.count();
    }
    return best;
}

std::vector<double> white(std::size_t count) {
    std::mt19937_64 engine(1);
    std::vector<double> v(count);
    for (double& x : v) x = static_cast<double>(static_cast<std::int64_t>(engine() >> 11)) / 4503599627370496.0 - 1;
    return v;
}

/// The recursive accumulator on double samples or 16-bit codes, in blocks as they come from a bus.
row direct(const bench_case& c, int p, bool codes) {
    constexpr int samples = 20000, block = 500;
    const int m = c.n_u + c.n_y;
    okid_accumulator_config_t config{};
    config.n_u = c.n_u;
    config.n_y = c.n_y;
    config.lags = p;
    config.sample = codes ? OKID_SAMPLE_INT16 : OKID_SAMPLE_DOUBLE;
    config.forgetting = 1;
    std::vector<char> memory(okid_accumulator_memsize(&config));
    okid_accumulator_t* a = nullptr;
    if (okid_accumulator_create(&a, &config, memory.data(), memory.size()) != OKID_OK) return {};
    const std::vector<double> v = white(static_cast<std::size_t>(samples * m));
    std::vector<std::int16_t> words(v.size());
    std::transform(v.begin(), v.end(), words.begin(), [](double x) { return static_cast<std::int16_t>(x * 30000); });
    const double seconds = seconds_of([&] {
        for (int n = 0; n < samples; n += block) {
            const auto at = static_cast<std::size_t>(n * m);
            const okid_status_t status = codes ? okid_accumulator_add_i16(a, words.data() + at, block)
                                               : okid_accumulator_add(a, v.data() + at, block);
            if (status < 0) return;
        }
    });
    const double per_sample = seconds / samples;
    config.buffer = 1; // waiting samples are no state: the sums are the same without them, bit for bit
    return {c.name,           codes ? "direct_i16" : "direct",           p,
            per_sample * 1e9, 2.0 * m * m * (p + 1) / per_sample * 1e-9, okid_accumulator_memsize(&config)};
}

/// The second kernel: block QR of the whole lag row, for hardware with a single-precision unit only.
row block_qr(const bench_case& c, int p) {
    const int m = c.n_u + c.n_y, q = c.n_u + p * m, samples = std::max(600, 40000000 / (q * q));
    okid_square_root_config_t config{};
    config.n_u = c.n_u;
    config.n_y = c.n_y;
    config.lags = p;
    config.forgetting = 1;
    std::vector<char> memory(okid_square_root_memsize(&config));
    okid_square_root_t* a = nullptr;
    if (okid_square_root_create(&a, &config, memory.data(), memory.size()) != OKID_OK) return {};
    const std::vector<double> v = white(static_cast<std::size_t>(samples * m));
    const double seconds = seconds_of([&] {
        if (okid_square_root_add(a, v.data(), static_cast<std::size_t>(samples)) < 0) return;
    });
    const double per_sample = seconds / samples, flop = 2.0 * (q + c.n_y) * (q + c.n_y);
    return {c.name, "qr", p, per_sample * 1e9, flop / per_sample * 1e-9, memory.size()};
}

/// Textbook recursive least squares: one rank-one update of the q x q inverse a sample.
row rls(const bench_case& c, int p) {
    const int m = c.n_u + c.n_y, q = c.n_u + p * m, samples = std::max(20, 4000000 / (q * q));
    const std::vector<double> v = white(static_cast<std::size_t>((samples + p) * m));
    Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(q, q) * 1e6, theta = Eigen::MatrixXd::Zero(q, c.n_y);
    Eigen::VectorXd phi(q), gain(q);
    const double seconds = seconds_of([&] {
        for (int n = p; n < samples + p; ++n) {
            const double* now = v.data() + static_cast<std::size_t>(n * m);
            phi.head(c.n_u) = Eigen::Map<const Eigen::VectorXd>(now, c.n_u);
            for (int lag = 1; lag <= p; ++lag)
                phi.segment(c.n_u + (lag - 1) * m, m) = Eigen::Map<const Eigen::VectorXd>(now - lag * m, m);
            gain.noalias() = inverse * phi;
            gain /= 1 + phi.dot(gain);
            const Eigen::Map<const Eigen::VectorXd> y(now + c.n_u, c.n_y);
            theta.noalias() += gain * (y - theta.transpose() * phi).transpose();
            inverse.noalias() -= gain * (phi.transpose() * inverse);
        }
    });
    const double per_sample = seconds / samples, flop = 6.0 * q * q + 4.0 * q * c.n_y;
    return {c.name,
            "rls",
            p,
            per_sample * 1e9,
            flop / per_sample * 1e-9,
            static_cast<std::size_t>(q) * static_cast<std::size_t>(q + c.n_y) * 8};
}

/// The same sums as one product of m x 4096 by 4096 x m(p+1) with OpenBLAS, lag matrix already made.
row dgemm(const bench_case& c, int p) {
    constexpr int samples = 4096;
    const int m = c.n_u + c.n_y, width = m * (p + 1);
    const std::vector<double> v = white(static_cast<std::size_t>(samples * m)),
                              lags = white(static_cast<std::size_t>(samples) * static_cast<std::size_t>(width));
    std::vector<double> sums(static_cast<std::size_t>(m * width));
    const double seconds = seconds_of([&] {
        cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, m, width, samples, 1, v.data(), m, lags.data(), width, 1,
                    sums.data(), m);
    });
    const double per_sample = seconds / samples;
    return {c.name, "dgemm", p, per_sample * 1e9, 2.0 * m * width / per_sample * 1e-9, sums.size() * 8};
}

/// LAPACK least squares (QR) on the whole record.
row lapack_ls(const bench_case& c, int p) {
    const int m = c.n_u + c.n_y, q = c.n_u + p * m, samples = std::max(2000, 4 * q);
    const std::vector<double> v = white(static_cast<std::size_t>(samples) * static_cast<std::size_t>(q)),
                              y = white(static_cast<std::size_t>(samples * c.n_y));
    std::vector<double> a, b;
    double seconds = 1e9;
    for (int round = 0; round < 2; ++round) {
        a = v;
        b = y;
        const auto begin = std::chrono::steady_clock::now();
        LAPACKE_dgels(LAPACK_COL_MAJOR, 'N', samples, q, c.n_y, a.data(), samples, b.data(), samples);
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
        seconds = std::min(seconds, took.count());
    }
    const double per_sample = seconds / samples, flop = 2.0 * q * q + 4.0 * q * c.n_y;
    return {c.name, "lapack_ls", p, per_sample * 1e9, flop / per_sample * 1e-9, v.size() * 8};
}

/// The Gram sums of a whole record of 16-bit codes: one call of the accumulator (FFT path), or OpenBLAS on blocks of 4096.
row whole_record(const bench_case& c, int p, int samples, bool fft) {
    const int m = c.n_u + c.n_y, width = m * (p + 1);
    const auto numbers = static_cast<std::size_t>(samples) * static_cast<std::size_t>(m);
    const std::vector<double> v = white(numbers);
    double seconds = 0;
    std::size_t bytes = 0;
    if (fft) {
        const okid_accumulator_config_t config{c.n_u, c.n_y, p, OKID_SAMPLE_INT16, 0, 0, 1, 0, 0, 1};
        std::vector<std::int16_t> codes(numbers);
        std::transform(v.begin(), v.end(), codes.begin(),
                       [](double x) { return static_cast<std::int16_t>(x * 30000); });
        std::vector<char> memory(okid_accumulator_memsize(&config));
        std::vector<double> gram(static_cast<std::size_t>(width) * static_cast<std::size_t>(width));
        okid_accumulator_t* a = nullptr;
        if (okid_accumulator_create(&a, &config, memory.data(), memory.size()) != OKID_OK) return {};
        bytes = memory.size();
        seconds = seconds_of([&] {
            okid_accumulator_reset(a);
            if (okid_accumulator_add_i16(a, codes.data(), static_cast<std::size_t>(samples)) < 0) return;
            okid_accumulator_gap(a, 0); // ends the run: everything that waits goes into the sums
        });
    } else {
        constexpr int block = 4096;
        const std::vector<double> lags = white(static_cast<std::size_t>(block) * static_cast<std::size_t>(width));
        std::vector<double> sums(static_cast<std::size_t>(m * width));
        bytes = (lags.size() + sums.size()) * 8;
        seconds = seconds_of([&] {
            for (int n = 0; n < samples; n += block)
                cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, m, width, std::min(block, samples - n), 1,
                            v.data() + static_cast<std::size_t>(n) * static_cast<std::size_t>(m), m, lags.data(), width,
                            1, sums.data(), m);
        });
    }
    const double per_sample = seconds / samples;
    return {c.name, fft ? "fft" : "dgemm_blocks", p, per_sample * 1e9, 2.0 * m * width / per_sample * 1e-9, bytes};
}

struct bench_options {
    bool json = false;
    std::string save, only;
};

double cost(const std::vector<row>& rows, const std::string& name, int p, const std::string& kernel) {
    for (const row& r : rows)
        if (r.name == name && r.p == p && r.kernel == kernel) return r.ns_per_sample;
    return 0;
}

void print(const std::vector<row>& rows, const nlohmann::ordered_json& list, const nlohmann::ordered_json& ratios) {
    if (!rows.empty())
        fmt::print("{:4} {:>3}  {:11} {:>12} {:>9} {:>11}\n", "case", "p", "kernel", "ns/sample", "GFLOP/s",
                   "state KiB");
    for (const row& r : rows)
        fmt::print("{:4} {:3}  {:11} {:12.1f} {:9.1f} {:11.1f}\n", r.name, r.p, r.kernel, r.ns_per_sample, r.gflops,
                   static_cast<double>(r.state_bytes) / 1024);
    print_identifications(list);
    fmt::print("\nratios within this run\n");
    for (const auto& [key, value] : ratios.items()) fmt::print("  {:52} {:8.2f}\n", key, value.get<double>());
}

/// The cost of a sample: rows "absorb" and "whole_record".
std::vector<row> bench_kernels(nlohmann::ordered_json& list, nlohmann::ordered_json& ratios) {
    std::vector<row> rows;
    for (const bench_case& c : cases)
        for (const int p : horizons) {
            rows.push_back(direct(c, p, false));
            rows.push_back(direct(c, p, true));
            rows.push_back(dgemm(c, p));
            rows.push_back(rls(c, p));
            rows.push_back(block_qr(c, p));
            rows.push_back(lapack_ls(c, p));
        }
    const std::pair<int, std::pair<int, int>> records[] = {{1, {60, 20000}}, {2, {50, 100000}}}; // case, lags, samples
    for (const auto& [which, size] : records)
        for (const bool fft : {true, false}) rows.push_back(whole_record(cases[which], size.first, size.second, fft));
    for (const auto& [which, size] : records)
        ratios[fmt::format("dgemm_blocks_over_fft_{}_p{}", cases[which].name, size.first)] =
            cost(rows, cases[which].name, size.first, "dgemm_blocks") /
            cost(rows, cases[which].name, size.first, "fft");
    for (const bench_case& c : cases)
        for (const int p : horizons) {
            const double own = cost(rows, c.name, p, "direct");
            const std::string suffix = fmt::format("_over_direct_{}_p{}", c.name, p);
            for (const char* other : {"rls", "qr", "dgemm", "lapack_ls", "direct_i16"})
                ratios[other + suffix] = cost(rows, c.name, p, other) / own;
        }
    for (const row& r : rows)
        list.push_back({{"name", r.kernel == "fft" || r.kernel == "dgemm_blocks" ? "whole_record" : "absorb"},
                        {"case", r.name},
                        {"p", r.p},
                        {"kernel", r.kernel},
                        {"ns_per_sample", r.ns_per_sample},
                        {"gflops", r.gflops},
                        {"state_bytes", r.state_bytes}});
    return rows;
}

void run_bench(const bench_options& options) {
    openblas_set_num_threads(1);
    std::vector<row> rows;
    nlohmann::ordered_json ratios = nlohmann::ordered_json::object(), list = nlohmann::ordered_json::array();
    if (options.only != "identifications") rows = bench_kernels(list, ratios);
    if (options.only != "kernels") bench_identifications(list);
    const blas_kernels blas = blas_in_use();
    nlohmann::ordered_json machine{{"backend", okid_backend()}, {"threads", 1}, {"pointer_bits", 8 * sizeof(void*)}};
    if (!blas.name.empty()) machine.update({{"blas", blas.version}, {"blas_kernels", blas.name}});
    const nlohmann::ordered_json all{
        {"schema", "okid.bench/1"}, {"machine", machine}, {"rows", list}, {"ratios", ratios}};
    if (options.json)
        fmt::print("{}\n", all.dump(1));
    else
        print(rows, list, ratios);
    if (!blas.name.empty() && !options.json) fmt::print("\n{}, kernels for {}\n", blas.version, blas.name);
    if (!blas.better.empty())
        fmt::print(stderr, "note: kernels for {} are a fallback on this processor, all times are longer: {}\n",
                   blas.name, remedy_of(blas));
    if (!options.save.empty()) write_whole_file(options.save, all.dump(1) + "\n");
}

} // namespace

void add_bench(CLI::App& app) {
    auto options = std::make_shared<bench_options>();
    CLI::App* command = app.add_subcommand(
        "bench", "Measure what a sample and a whole identification cost, beside others in the same run");
    command->add_flag("--json", options->json, "print okid.bench/1 instead of a table");
    command->add_option("--save", options->save, "also write okid.bench/1 to this file")->type_name("FILE.json");
    command->add_option("--only", options->only, "leave the other half out")
        ->type_name("kernels|identifications")
        ->check(CLI::IsMember({"kernels", "identifications"}).description(""));
    command->footer("Example:\n  okid bench --json > bench.json\n  okid bench --only identifications");
    command->callback([options] { run_bench(*options); });
}

} // namespace okid_host
