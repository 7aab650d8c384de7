// SPDX-License-Identifier: MIT
// PURPOSE  frequency responses in the memory of a caller, or in files, to a result
#include "guard.hpp"
#include "options.hpp"
#include "result_handle.hpp"

#include "frequency/identify_responses.hpp"
#include "frequency/response_file.hpp"

#include <memory>
#include <nlohmann/json.hpp>
#include <okid_host/responses.h>

struct okid_host_responses {
    okid_host::response_set set;
    std::string json;
    std::vector<std::complex<double>> values; ///< line by line, inputs, outputs
};

using namespace okid_host;

int32_t okid_host_identify_responses(const char* options, size_t lines, const double* frequency_hz,
                                     const double* response, okid_host_result_t** result) {
    if (result) *result = nullptr;
    return face::guard([&] {
        face::given(result, options);
        face::given_where(lines > 0, frequency_hz, response);
        response_request asked;
        record_request& wanted = asked.wanted;
        std::string set_ups;
        face::option_places places = face::places_of(wanted, of_responses);
        response_set set;
        places.texts.insert(places.texts.end(),
                            {{"set_ups", &set_ups}, {"exponential", &asked.exponential}, {"quantity", &set.quantity}});
        places.lists.emplace_back("other_units", &set.other_units);
        places.flags.emplace_back("all_modes", &asked.all_modes);
        face::read_options(options, places);
        set.inputs = wanted.inputs;
        set.outputs = wanted.outputs;
        if (!set_ups.empty()) set.set_ups = static_cast<int>(whole_number("set_ups", set_ups, 1, 1000000));
        set.frequency_hz.assign(frequency_hz, frequency_hz + lines);
        const auto rows = static_cast<Eigen::Index>(lines);
        using by_line = Eigen::Matrix<std::complex<double>, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        const auto* values = reinterpret_cast<const std::complex<double>*>(response);
        set.H = Eigen::Map<const by_line>(values, rows, set.n_y() * set.n_u());
        *result = face::make_result(identify_responses(set, asked));
    });
}

int32_t okid_host_responses_read(const char* const* paths, int32_t count, okid_host_responses_t** out) {
    if (out) *out = nullptr;
    return face::guard([&] {
        face::given(out);
        face::given_where(count > 0, paths);
        auto made = std::make_unique<okid_host_responses_t>();
        for (int32_t i = 0; i < count; ++i) face::given(paths[i]);
        made->set = read_set_ups(std::vector<std::string>(paths, paths + count));
        for (Eigen::Index l = 0; l < made->set.lines(); ++l)
            for (Eigen::Index c = 0; c < made->set.H.cols(); ++c) made->values.push_back(made->set.H(l, c));
        const nlohmann::json about = {{"inputs", made->set.inputs},
                                      {"outputs", made->set.outputs},
                                      {"set_ups", made->set.set_ups},
                                      {"quantity", made->set.quantity},
                                      {"other_units", made->set.other_units}};
        made->json = about.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
        *out = made.release();
    });
}

const char* okid_host_responses_json(const okid_host_responses_t* self) { return self ? self->json.c_str() : nullptr; }

size_t okid_host_responses_data(const okid_host_responses_t* self, const double** frequency_hz,
                                const double** response) {
    if (frequency_hz) *frequency_hz = self ? self->set.frequency_hz.data() : nullptr;
    if (response) *response = self ? reinterpret_cast<const double*>(self->values.data()) : nullptr;
    return self ? self->set.frequency_hz.size() : 0;
}

void okid_host_responses_delete(okid_host_responses_t* self) { delete self; }
