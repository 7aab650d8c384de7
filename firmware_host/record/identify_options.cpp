// SPDX-License-Identifier: MIT
// METHOD   an option is a line with the place of its value; what a command line, a JSON object or a CONFIG.toml must know of it is
//          read from there. A new one: a line here, its member of record_request, and its use in request.cpp
#include "identify_options.hpp"

#include "result/deviations.hpp"
#include "result/method.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace okid_host {
namespace {

std::vector<identify_option> make_options() {
    using kind = option_kind;
    using of = option_methods;
    using asked = record_request;
    constexpr unsigned everywhere = of_streams | of_configs, sides = of_streams | of_responses;
    const std::string methods = fmt::format("auto|{}|{}", fmt::join(method_names(), "|"), lag_method);
    const std::string hankels = fmt::format("{}", fmt::join(hankel_names(), "|"));
    return {
        {"inputs", kind::names, &asked::inputs, "NAMES", of::all, sides,
         "force columns, with commas between; without it, or with none: ambient, modes only"},
        {"outputs", kind::names, &asked::outputs, "NAMES", of::all, sides, "response columns, with commas between"},
        {"fs", kind::text, &asked::fs, "HZ", of::all, of_streams, "sample rate; default: what the file says"},
        {"method", kind::words, &asked::method, methods, of::all, everywhere,
         "how the model is found: auto (default), what several methods agree on, or one of them. With an option of one "
         "method alone (--p, --rows, --order, --max-order, --hankel, --refine, --stabilization) okid-era. plscf: modes "
         "from correlations through frequency responses"},
        {"p", kind::whole, &asked::p, "N", of::one, everywhere, "observer order in samples (default 40; not for n4sid)",
         1, 4096},
        {"rows", kind::whole, &asked::rows, "N", of::one, everywhere,
         "block rows of the Hankel matrix (default 2 p, n4sid 30, okid without inputs p)", 2, 100000},
        {"hankel", kind::words, &asked::hankel, hankels, of::one, everywhere,
         "what the Hankel matrix of the okid methods holds: system (default), innovations (those too, weighted: free "
         "of units) or literal (eq. 42 as printed, for comparison only)"},
        {"order", kind::whole_or_auto, &asked::order, "N|auto", of::one, everywhere,
         "number of states, or auto (default)", 1, 10000},
        {"max-order", kind::whole, &asked::max_order, "N", of::one, of_streams, "largest order that auto may choose", 1,
         10000},
        {"hold", kind::words, &asked::hold, "auto|zoh|foh|band", of::all, everywhere,
         "force between samples: held (zoh), linear (foh) or band-limited, as a load cell behind an anti-alias filter "
         "gives it (band); auto (default of --method auto) determines it from the record"},
        {"band", kind::text, &asked::band, "LO:HI", of::agreement_or_lags, everywhere | of_responses,
         "only modes in this band, Hz (auto, plscf)"},
        {"decimate", kind::whole_or_auto, &asked::decimate, "N|auto", of::agreement, everywhere,
         "--method auto looks at no higher rate than one Nth of the record's (default auto: all rates)", 1, 1000},
        {"threads", kind::whole, &asked::threads, "N", of::agreement, 0,
         "processors for --method auto (default: all it may use); the result is the same for any number", 1, 1024},
        {"modes", kind::text, &asked::modes, "1,3-5", of::agreement_or_lags, of_responses,
         "only these modes, by their numbers in the table (auto, plscf)"},
        {"picks", kind::text, &asked::picks, "FILE.json|HZ,HZ", of::agreement, 0,
         "only the modes nearest to these poles: frequencies in Hz, or a .json with modes (auto)"},
        {"detrend", kind::words, &asked::detrend, "none|mean|linear", of::all, everywhere,
         "what is removed from every channel first (default mean)"},
        {"start", kind::words, &asked::start, "moving|rest", of::all, 0,
         "moving (default): nothing is known before the record; rest: every record begins with the structure at rest, "
         "as "
         "a hammer test with a short pre-trigger does"},
        {"sensing", kind::text, &asked::sensing, "acceleration|velocity|displacement", of::all, sides,
         "what the outputs measure (default acceleration, of --frf what the file says): one kind, or one per output "
         "with "
         "commas between"},
        {"input-dofs", kind::text, &asked::input_dofs, "LIST", of::all, sides,
         "where each force acts: numbers of degrees of freedom from 1 (-3: at 3, polarity reversed). With "
         "--output-dofs: "
         "mass, stiffness and damping matrices"},
        {"output-dofs", kind::text, &asked::output_dofs, "LIST", of::all, sides,
         "where each sensor stands; every degree of freedom needs a force or a sensor, one needs both"},
        {"hit-dofs", kind::text, &asked::hit_dofs, "LIST", of::all, 0,
         "roving hammer: where each record was struck, one number a record in their order (-3: at 3, direction "
         "reversed). Each place becomes an input of its own"},
        {"keep-all", kind::flag, &asked::keep_all, "", of::all, 0,
         "use the bad hits of --hit-dofs, --places and --setups too (a double hit, an overload ...)"},
        {"refine", kind::answer, &asked::refine, "auto|yes|no", of::all, everywhere,
         "improve the model by maximum likelihood: with noise at the sensors no unbiased estimate is more exact. Needs "
         "--inputs. --refine=auto, the default of method auto: if the noise is white and every mode keeps its "
         "identity; "
         "--refine=no"},
        {"stabilization", kind::flag, &asked::stabilization, "", of::all, of_responses,
         "look at all orders and three horizons too, and list the stable modes (JSON: \"stabilization\"); of auto the "
         "poles of all runs (JSON: \"agreement\")"},
        {"sigma", kind::words, &asked::sigma, "analytic|jackknife|none", of::all, everywhere,
         "standard deviations: analytic (default; the method's derivative along each block of the record), jackknife "
         "(identified again without each block; also where a method has no derivative), none"},
        {"sigma-blocks", kind::whole, &asked::sigma_blocks, "N", of::all, everywhere,
         "blocks of the record for the standard deviations (default 20), 0 = none. Without --sigma: jackknife", 0,
         most_blocks},
    };
}

} // namespace

std::string identify_option::key() const {
    std::string out = name;
    std::replace(out.begin(), out.end(), '-', '_');
    return out;
}

std::vector<std::string> identify_option::alternatives() const {
    std::vector<std::string> out;
    for (std::size_t at = 0; at <= shape.size();) {
        const std::size_t bar = std::min(shape.find('|', at), shape.size());
        out.push_back(shape.substr(at, bar - at));
        at = bar + 1;
    }
    return out;
}

bool identify_option::is_given(const record_request& request) const {
    static const record_request silent;
    return std::visit([&](auto at) { return request.*at != silent.*at; }, place);
}

const std::vector<identify_option>& identify_options() {
    static const std::vector<identify_option> options = make_options();
    return options;
}

} // namespace okid_host
