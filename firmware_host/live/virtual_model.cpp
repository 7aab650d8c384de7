// SPDX-License-Identifier: MIT
// PURPOSE  the file of virtual sensors, checked whole
// METHOD   JSON of schema okid.virtual/1; sizes follow from C and D
#include "virtual_model.hpp"

#include "error.hpp"

#include <cmath>
#include <fmt/format.h>

namespace okid_host {
namespace {

constexpr const char* virtual_schema = "okid.virtual/1";

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;
using nlohmann::ordered_json;

[[noreturn]] void refuse_key_of_model(const char* key, const std::string& found, const std::string& expected) {
    throw failure(exit_usage, fmt::format("{}: found {}, expected {}", key, found, expected));
}

/// `rows` or `columns` below 0: as many as there are.
MatrixXd model_matrix(const json& from, const char* key, Index rows, Index columns) {
    const auto found = from.find(key);
    if (found == from.end() || !found->is_array()) refuse_key_of_model(key, "no matrix", "a list of rows");
    const auto n = static_cast<Index>(found->size());
    if (columns < 0) columns = n > 0 && found->front().is_array() ? static_cast<Index>(found->front().size()) : 0;
    if (rows >= 0 && n != rows) refuse_key_of_model(key, fmt::format("{} rows", n), std::to_string(rows));
    MatrixXd out(n, columns);
    for (Index r = 0; r < n; ++r) {
        const json& row = (*found)[static_cast<std::size_t>(r)];
        if (!row.is_array() || static_cast<Index>(row.size()) != columns)
            refuse_key_of_model(key, fmt::format("another row {}", r + 1), fmt::format("{} numbers", columns));
        for (Index c = 0; c < columns; ++c) {
            const json& one = row[static_cast<std::size_t>(c)];
            if (!one.is_number() || !std::isfinite(one.get<double>())) refuse_key_of_model(key, one.dump(), "numbers");
            out(r, c) = one.get<double>();
        }
    }
    return out;
}

/// @param least  every number is above it
VectorXd model_numbers(const json& from, const char* key, Index count, double least) {
    const auto found = from.find(key);
    if (found == from.end() || found->is_null()) return {};
    const json rows = json::array({*found});
    const json wrapped = {{key, rows}};
    const VectorXd out = model_matrix(wrapped, key, 1, count).row(0).transpose();
    if ((out.array() <= least).any())
        refuse_key_of_model(key, fmt::format("{:g}", out.minCoeff()), fmt::format("above {:g}", least));
    return out;
}

std::vector<std::string> model_names(const json& from, const char* key, Index count, char letter) {
    std::vector<std::string> out;
    if (const auto found = from.find(key); found != from.end() && found->is_array()) {
        for (const json& one : *found) {
            if (!one.is_string()) refuse_key_of_model(key, one.dump(), "names");
            out.push_back(one.get<std::string>());
        }
    } else {
        for (Index k = 1; k <= count; ++k) out.push_back(fmt::format("{}{}", letter, k));
    }
    if (static_cast<Index>(out.size()) != count)
        refuse_key_of_model(key, fmt::format("{} names", out.size()), fmt::format("{}, as the model has", count));
    return out;
}

ordered_json matrix_rows(const MatrixXd& from) {
    ordered_json out = ordered_json::array();
    for (Index r = 0; r < from.rows(); ++r) {
        const VectorXd row = from.row(r).transpose();
        out.push_back(std::vector<double>(row.data(), row.data() + row.size()));
    }
    return out;
}

ordered_json vector_numbers(const VectorXd& from) {
    if (from.size() == 0) return nullptr;
    return std::vector<double>(from.data(), from.data() + from.size());
}

} // namespace

virtual_model virtual_model_of(const json& from) {
    if (!from.is_object() || from.value("schema", json()) != virtual_schema)
        throw failure(
            exit_usage,
            fmt::format("found no \"schema\": \"{}\", expected a file of okid.VirtualSensors.save()", virtual_schema));
    const auto inner = from.find("model");
    if (inner == from.end() || !inner->is_object()) refuse_key_of_model("model", "none", "A, B, C, D, K and dt");
    const json& model = *inner;
    virtual_model out;
    const auto dt = model.find("dt");
    if (dt == model.end() || !dt->is_number() || !(dt->get<double>() > 0))
        refuse_key_of_model("dt", "no time", "seconds");
    out.dt = dt->get<double>();
    out.C = model_matrix(model, "C", -1, -1);
    const Index n = out.C.cols(), n_y = out.C.rows();
    out.A = model_matrix(model, "A", n, n);
    out.D = model_matrix(model, "D", n_y, -1);
    const Index n_u = out.D.cols();
    out.B = model_matrix(model, "B", n, n_u);
    out.K = model_matrix(model, "K", n, n_y);
    if (n_y == 0) refuse_key_of_model("C", "no rows", "one an output");
    out.inputs = model_names(from, "inputs", n_u, 'u');
    out.outputs = model_names(from, "outputs", n_y, 'y');
    out.noise = model_matrix(from, "noise", n_y, n_y);
    if ((out.noise - out.noise.transpose()).cwiseAbs().maxCoeff() > 1e-8 * out.noise.cwiseAbs().maxCoeff() ||
        Eigen::LLT<MatrixXd>(out.noise).info() != Eigen::Success)
        refuse_key_of_model("noise", "another matrix", fmt::format("a positive definite ({0}, {0}) covariance", n_y));
    out.mean = model_numbers(from, "mean", n_u + n_y, -INFINITY);
    if (out.mean.size() == 0) out.mean.setZero(n_u + n_y);
    out.widen = model_numbers(from, "widen", n_y, 0);
    if (out.widen.size() == 0) out.widen.setOnes(n_y);
    out.input_std = model_numbers(from, "input_std", n_u, -1e-300);
    out.force_std = model_numbers(from, "force_std", n_u, 0);
    const json hz = from.value("force_hz", json());
    if (hz.is_number()) out.force_hz = hz.get<double>();
    if (!hz.is_null() && !(out.force_hz > 0)) refuse_key_of_model("force_hz", hz.dump(), "above 0");
    if (out.force_hz > 0 && !out.estimates_forces()) refuse_key_of_model("force_hz", hz.dump(), "force_std beside it");
    return out;
}

ordered_json virtual_model_json(const virtual_model& m) {
    return {{"schema", virtual_schema},
            {"inputs", m.inputs},
            {"outputs", m.outputs},
            {"model",
             {{"dt", m.dt},
              {"A", matrix_rows(m.A)},
              {"B", matrix_rows(m.B)},
              {"C", matrix_rows(m.C)},
              {"D", matrix_rows(m.D)},
              {"K", matrix_rows(m.K)}}},
            {"noise", matrix_rows(m.noise)},
            {"mean", vector_numbers(m.mean)},
            {"widen", vector_numbers(m.widen)},
            {"input_std", vector_numbers(m.input_std)},
            {"force_std", vector_numbers(m.force_std)},
            {"force_hz", m.force_hz > 0 ? ordered_json(m.force_hz) : ordered_json(nullptr)}};
}

} // namespace okid_host
