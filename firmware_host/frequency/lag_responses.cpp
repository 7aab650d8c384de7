// SPDX-License-Identifier: MIT
// PURPOSE  frequency responses without leakage, from sums
// METHOD   correlations by FFT over blocks that overlap by the lags; impulse responses by block Levinson recursion on the
//          correlations of the inputs; an exponential window, so that what comes behind the last lag does not matter
// REFERENCE Whittle (1963), block Levinson; Peeters, Van der Auweraer (2005), positive power spectra; Cauberghe (2004)
// NUMERICS ridge 1e-4 of the inputs' power: bands that they hardly excite stay bounded
#include "lag_responses.hpp"

#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/FFT>

namespace okid_host {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using spectrum = std::vector<std::complex<double>>;

constexpr double force_ridge = 1e-4;
constexpr double end_of_correlation = 0.01, end_of_response = 0.1; // of the window: correlations err at long lags
constexpr std::size_t least_block = 8192;
constexpr double least_force = 0.01; // of its greatest power

/// Correlations of blocks of one record, summed in frequency.
class block_correlator {
  public:
    block_correlator(std::size_t channels, std::vector<std::size_t> references, std::size_t lags)
        : m_(channels), references_(std::move(references)), lags_(lags) {
        size_ = least_block;
        while (size_ < 4 * lags_) size_ *= 2;
        fft_.SetFlag(Eigen::FFT<double>::HalfSpectrum);
        sums_.assign(m_ * references_.size() + 1, spectrum(size_ / 2 + 1));
    }
    /// Samples first .. last-1 with what lies up to the lags before them.
    void add(const double* rows, std::size_t first, std::size_t last) {
        for (const std::size_t step = size_ - lags_; first < last; first += step)
            add_block(rows, first, std::min(last, first + step));
    }
    lag_sums finish(std::size_t n_u) {
        lag_sums out{n_u, references_, MatrixXd(lags_ + 1, m_ * references_.size()), VectorXd(lags_ + 1)};
        std::vector<double> x;
        for (std::size_t k = 0; k < sums_.size(); ++k) {
            fft_.inv(x, sums_[k], static_cast<Index>(size_));
            for (std::size_t d = 0; d <= lags_; ++d) {
                const auto row = static_cast<Index>(d);
                if (k + 1 < sums_.size())
                    out.products(row, static_cast<Index>(k)) = x[lags_ - d];
                else
                    out.pairs[row] = std::round(x[lags_ - d]);
            }
        }
        return out;
    }

  private:
    void add_block(const double* rows, std::size_t first, std::size_t last) {
        const std::size_t before = std::min(first, lags_);
        std::vector<bool> there;
        for (std::size_t i = first - before; i < last; ++i) there.push_back(all_measured(rows + i * m_, m_));
        // `late`: the block itself; `early`: with the past in front, `lags_` places later than its time
        const auto transform = [&](bool early, auto value) {
            std::vector<double> x(size_, 0.0);
            for (std::size_t i = early ? first - before : first; i < last; ++i)
                if (there[i - (first - before)]) x[i - first + (early ? lags_ : 0)] = value(i);
            spectrum out;
            fft_.fwd(out, x);
            return out;
        };
        const auto channel = [&](std::size_t c) { return [=](std::size_t i) { return rows[i * m_ + c]; }; };
        const auto one = [](std::size_t) { return 1.0; };
        const auto sum = [&](const spectrum& late, const spectrum& early, spectrum& to) {
            for (std::size_t f = 0; f < to.size(); ++f) to[f] += std::conj(late[f]) * early[f];
        };
        std::vector<spectrum> early;
        for (const std::size_t r : references_) early.push_back(transform(true, channel(r)));
        for (std::size_t c = 0; c < m_; ++c) {
            const spectrum late = transform(false, channel(c));
            for (std::size_t r = 0; r < references_.size(); ++r) sum(late, early[r], sums_[c + m_ * r]);
        }
        sum(transform(false, one), transform(true, one), sums_.back());
    }

    std::size_t m_;
    std::vector<std::size_t> references_;
    std::size_t lags_, size_ = 0;
    std::vector<spectrum> sums_; ///< of the pairs of channels, last of the samples that are there
    Eigen::FFT<double> fft_;
};

/// Blocks g_d with sum_d T(k - d) g_d = c_k: T(m) = G_m^T for m > 0, else G_-m. @param G  n x n (lags + 1) side by side
class block_levinson {
  public:
    explicit block_levinson(MatrixXd G) : G_(std::move(G)), n_(G_.rows()), count_(G_.cols() / n_) {
        turned_.resize(n_, n_ * count_); // G_L^T .. G_0^T
        for (Index d = 0; d < count_; ++d)
            turned_.middleCols((count_ - 1 - d) * n_, n_) = G_.middleCols(d * n_, n_).transpose();
    }
    /// @param c  blocks of n rows below each other
    MatrixXd solve(const MatrixXd& c) {
        const Index rows = n_ * count_;
        MatrixXd F = MatrixXd::Zero(rows, n_), B = F, x = MatrixXd::Zero(rows, c.cols());
        MatrixXd Ef = G_.leftCols(n_), Eb = Ef;
        F.topRows(n_).setIdentity();
        B.topRows(n_).setIdentity(); // block k of B stands at the row of its block
        x.topRows(n_) = Ef.ldlt().solve(c.topRows(n_));
        for (Index k = 1; k < count_; ++k) {
            const Index size = k * n_;
            const auto past = turned_.middleCols((count_ - 1 - k) * n_, size); // T(k - j), j = 0 .. k-1
            const MatrixXd af = past * F.topRows(size), ab = G_.middleCols(n_, size) * B.topRows(size);
            const MatrixXd bf = Eb.ldlt().solve(af), fb = Ef.ldlt().solve(ab);
            MatrixXd later = MatrixXd::Zero(size + n_, n_);
            later.bottomRows(size) = B.topRows(size);
            B.topRows(size + n_) = later - F.topRows(size + n_) * fb;
            F.topRows(size + n_) -= later * bf;
            Ef -= ab * bf;
            Eb -= af * fb;
            const MatrixXd left = c.middleRows(size, n_) - past * x.topRows(size);
            x.topRows(size + n_) += B.topRows(size + n_) * Eb.ldlt().solve(left);
        }
        return x;
    }

  private:
    MatrixXd G_, turned_;
    Index n_, count_;
};

MatrixXd block_of(const lag_sums& sums, Index lag, std::size_t first, std::size_t count) {
    const auto m = static_cast<Index>(sums.channels());
    MatrixXd out(count, sums.references.size());
    for (Index r = 0; r < out.cols(); ++r)
        out.col(r) = sums.products.row(lag).segment(m * r + static_cast<Index>(first), out.rows()).transpose();
    return out / std::max(1.0, sums.pairs[lag]);
}

/// Impulse responses: a row a lag, columns as those of response_set::H.
MatrixXd impulse_responses(const lag_sums& sums) {
    const auto n_u = static_cast<Index>(sums.n_u), n_y = static_cast<Index>(sums.channels() - sums.n_u);
    const Index count = sums.lags() + 1;
    MatrixXd G(n_u, n_u * count), c(n_u * count, n_y);
    for (Index d = 0; d < count; ++d) {
        G.middleCols(d * n_u, n_u) = block_of(sums, d, 0, sums.n_u);
        c.middleRows(d * n_u, n_u) = block_of(sums, d, sums.n_u, sums.channels() - sums.n_u).transpose();
    }
    G.leftCols(n_u).diagonal() *= 1 + force_ridge;
    block_levinson levinson(std::move(G));
    const MatrixXd g = levinson.solve(c);
    MatrixXd out(count, n_y * n_u);
    for (Index d = 0; d < count; ++d)
        for (Index i = 0; i < n_u; ++i) out.row(d).segment(n_y * i, n_y) = g.row(d * n_u + i);
    return out;
}

/// A column of numbers over the lags, under the window, in lines of half the spacing of the lags.
spectrum transformed(const VectorXd& decay, double rate) {
    const auto lags = static_cast<std::size_t>(decay.size() - 1);
    std::vector<double> x(2 * lags, 0.0);
    for (std::size_t d = 0; d <= lags; ++d)
        x[d] = decay[static_cast<Index>(d)] * std::exp(-rate * static_cast<double>(d));
    Eigen::FFT<double> fft;
    fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
    spectrum out;
    fft.fwd(out, x);
    return out;
}

/// The last line at which a force has power, in shares of the lines.
double top_of_forces(const lag_sums& sums, double rate) {
    double out = 0;
    for (Index i = 0; i < static_cast<Index>(sums.n_u); ++i) {
        VectorXd own =
            sums.products.col(i + static_cast<Index>(sums.channels()) * i).cwiseQuotient(sums.pairs.cwiseMax(1.0));
        own[0] /= 2;
        const spectrum power = transformed(own, 10 * rate); // smooth
        double most = 0;
        for (const auto& line : power) most = std::max(most, line.real());
        for (std::size_t k = power.size(); k-- > 0;)
            if (power[k].real() >= least_force * most) {
                out = std::max(out, static_cast<double>(k + 1) / static_cast<double>(power.size()));
                break;
            }
    }
    return out;
}

MatrixXd correlations(const lag_sums& sums) {
    MatrixXd out = sums.products;
    for (Index d = 0; d < out.rows(); ++d) out.row(d) /= std::max(1.0, sums.pairs[d]);
    out.row(0) /= 2; // of a sampled decay, half: what is left of the sum over the integral goes into the residuals
    return out;
}

} // namespace

std::vector<lag_sums> sum_lags(const record_set& set, const std::vector<std::size_t>& references, std::size_t lags,
                               std::size_t parts) {
    std::vector<lag_sums> out;
    const std::size_t count = set.count();
    for (std::size_t b = 0; b < parts; ++b) {
        block_correlator sums(set.channels(), references, lags);
        for (const record_data& record : set.records) {
            const std::size_t first = std::max(record.first, b * count / parts),
                              last = std::min(record.first + record.count, (b + 1) * count / parts);
            if (first < last) sums.add(set.rows(record), first - record.first, last - record.first);
        }
        out.push_back(sums.finish(set.n_u));
    }
    return out;
}

lag_sums operator+(lag_sums a, const lag_sums& b) {
    a.products += b.products;
    a.pairs += b.pairs;
    return a;
}

lag_sums operator-(lag_sums a, const lag_sums& b) {
    a.products -= b.products;
    a.pairs -= b.pairs;
    return a;
}

lag_responses responses_of(const lag_sums& sums, double fs_hz, const std::vector<std::string>& channels) {
    const auto lags = static_cast<std::size_t>(sums.lags());
    const MatrixXd decays = sums.n_u > 0 ? impulse_responses(sums) : correlations(sums);
    lag_responses out;
    const double rate = -std::log(sums.n_u > 0 ? end_of_response : end_of_correlation) / static_cast<double>(lags);
    out.constant_s = 1 / (rate * fs_hz);
    for (const std::size_t r : sums.references) out.set.inputs.push_back(channels[r]);
    out.set.outputs.assign(channels.begin() + static_cast<std::ptrdiff_t>(sums.n_u), channels.end());
    for (std::size_t k = 0; k <= lags; ++k)
        out.set.frequency_hz.push_back(fs_hz * static_cast<double>(k) / static_cast<double>(2 * lags));
    out.set.H.resize(static_cast<Index>(lags + 1), decays.cols());
    for (Index c = 0; c < decays.cols(); ++c) {
        const spectrum one = transformed(decays.col(c), rate);
        for (std::size_t k = 0; k <= lags; ++k) out.set.H(static_cast<Index>(k), c) = one[k];
    }
    if (sums.n_u > 0) out.top_hz = top_of_forces(sums, rate) * fs_hz / 2;
    return out;
}

} // namespace okid_host
