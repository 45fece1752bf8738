#include "sweep.h"

#include <algorithm>
#include <array>

#include "sorting.h"

namespace bsp {
namespace {

/// End points of a node's references along one direction, as floats: starts rounded down, ends rounded up. For a plane
/// whose offset is a float, comparing it with these gives the same answer as comparing it with the exact end points.
struct Events {
    std::vector<float> starts, ends, planar; ///< sorted; planar: references that lie in one plane of the family
    std::vector<float> scratch;

    void collect(const ReferenceList &references, const Direction &direction) {
        const std::size_t count = references.size();
        starts.resize(count);
        ends.resize(count);
        planar.clear();
        for (std::size_t i = 0; i < count; ++i) {
            const auto [low, high] = references.extent(i, direction);
            starts[i] = round_down(low);
            ends[i] = round_up(high);
            if (starts[i] == ends[i])
                planar.push_back(starts[i]);
        }
        sort_floats(starts, scratch);
        sort_floats(ends, scratch);
        sort_floats(planar, scratch);
    }
};

/// What is kept from one sweep to the next: a node is swept many times.
struct Kept {
    Events events;
    AreaProfile profile;
};

/// Not inline, or loops would ask for its address again and again.
[[gnu::noinline]] Kept &kept_by_thread() {
    static thread_local Kept kept;
    return kept;
}

} // namespace

std::optional<SweptPlane> sweep(const ReferenceList &references, const Cell &cell, const Direction &direction,
                                const CostModel &cost, std::vector<float> *offsets) {
    auto &[events, profile] = kept_by_thread();
    events.collect(references, direction);
    const auto &[starts, ends, planar, scratch] = events;

    const std::uint32_t count = std::uint32_t(references.size());
    profile.reset(cell, direction);
    const double scale = 1 / cell.area();
    std::optional<SweptPlane> best;
    const auto consider = [&](float offset, bool planar_below, std::uint32_t below, std::uint32_t above,
                              double area_below, double area_above) {
        const double price = cost.split_price(area_below * scale, below, area_above * scale, above);
        if (!best || price < best->cost)
            best = SweptPlane{offset, planar_below, below, above, price, 0};
    };

    std::uint32_t started = 0, ended = 0, planar_seen = 0; // starts below, ends not above, planar ones handled
    while (ended < count) {
        const float offset = started < count ? std::min(starts[started], ends[ended]) : ends[ended];
        while (ended < count && ends[ended] <= offset)
            ++ended;
        std::uint32_t in_plane = 0;
        while (planar_seen < planar.size() && planar[planar_seen] == offset) {
            ++planar_seen;
            ++in_plane;
        }
        if (profile.lower() < offset && offset < profile.upper()) {
            if (offsets)
                offsets->push_back(offset);
            const auto [area_below, area_above] = profile.at(offset);
            const std::uint32_t below = started, above = count - ended;
            consider(offset, false, below, above + in_plane, area_below, area_above);
            if (in_plane > 0)
                consider(offset, true, below + in_plane, above, area_below, area_above);
        }
        while (started < count && starts[started] <= offset)
            ++started;
    }
    return best;
}

std::optional<SweptPlane> estimate(const ReferenceList &references, const Cell &cell, const Direction &direction,
                                   const CostModel &cost) {
    AreaProfile &profile = kept_by_thread().profile;
    profile.reset(cell, direction);
    constexpr std::size_t bins = 64;
    const double lower = profile.lower(), width = (profile.upper() - lower) / bins;
    if (!(width > 0))
        return std::nullopt;
    const auto bin_of = [&, per_width = 1 / width](double position) {
        return std::size_t(std::clamp((position - lower) * per_width, 0.0, double(bins - 1)));
    };
    std::array<std::uint32_t, bins> starts{}, ends{};
    for (std::size_t i = 0; i < references.size(); ++i) {
        const auto [low, high] = references.extent(i, direction);
        ++starts[bin_of(low)];
        ++ends[bin_of(high)];
    }

    const double scale = 1 / cell.area();
    std::optional<SweptPlane> best;
    std::uint32_t below = 0, above = std::uint32_t(references.size());
    for (std::size_t i = 1; i < bins; ++i) {
        below += starts[i - 1];
        above -= ends[i - 1];
        const double offset = lower + width * double(i);
        const auto [area_below, area_above] = profile.at(offset);
        const double price = cost.split_price(area_below * scale, below, area_above * scale, above);
        if (!best || price < best->cost)
            best = SweptPlane{float(offset), false, below, above, price};
    }
    return best;
}

} // namespace bsp
