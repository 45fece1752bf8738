/// Split sources: which directions a node may be cut along, besides the axes. Hoobergs 2019, chapter 4.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "direction.h"
#include "random.h"
#include "references.h"
#include "settings.h"
#include "triangles.h"

namespace bsp {

/// What a source may look at: the triangles of one node.
struct NodeTriangles {
    const TriangleSet &set;
    const ReferenceList &references;
};

/// Answers, per node, which directions may be tried. It never sees costs; the sweep never sees sources. Called from
/// many threads at once.
class SplitSource {
public:
    virtual ~SplitSource() = default;

    /// Up to `count` different directions for the node; the same for the same triangles and the same `random`.
    virtual std::vector<Direction> directions(const NodeTriangles &node, int count, Random random) const = 0;
};

/// The source of a tree; null for trees that have only the axes.
std::unique_ptr<SplitSource> make_split_source(const Settings &settings);

/// Radians: directions nearer to one another than this are one.
constexpr double same_direction_angle = 1e-3;

/// Appends `direction` unless one like it is there.
void add_distinct(std::vector<Direction> &directions, const Direction &direction);

} // namespace bsp
