#include "builder.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>

#include "cell.h"
#include "parallel.h"
#include "plane_survey.h"
#include "reference_hierarchy.h"
#include "references.h"
#include "split_source.h"
#include "sweep.h"
#include "triangle_planes.h"

namespace bsp {
namespace {

constexpr std::size_t estimated_planes = 63;           ///< per direction, by `estimate`
constexpr std::size_t most_tried = 256;                ///< of a large node, for the planes along them
constexpr std::size_t parallel_sweep_size = 1 << 15;   ///< from here on, directions are swept by different threads
constexpr std::size_t parallel_subtree_size = 1 << 10; ///< from here on, children are built by different threads

/// The part of the tree below one node while it is being built.
struct NodeWork {
    ReferenceList references;
    Cell cell;
    int depth = 0;
    int bad_refines = 0; ///< splits dearer than their leaf that may still follow
    double budget = 0;   ///< references the leaves below may list together
    double share = 1;    ///< of the whole work
    std::uint64_t seed = 0;
};

struct Split {
    TreeNode::Kind kind = TreeNode::Kind::axis;
    Direction direction;
    SweptPlane plane;
    double price = HUGE_VAL; ///< of the step and the children's triangles
};

/// Adds the seconds it lives to a sum.
class Stopwatch {
public:
    explicit Stopwatch(double &sum) : m_sum(sum) {}
    ~Stopwatch() {
        const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - m_start;
        m_sum += elapsed.count();
    }
    Stopwatch(const Stopwatch &) = delete;
    Stopwatch &operator=(const Stopwatch &) = delete;

private:
    double &m_sum;
    std::chrono::steady_clock::time_point m_start = std::chrono::steady_clock::now();
};

void merge(const std::vector<LevelCounts> &more, std::vector<LevelCounts> &levels) {
    levels.resize(std::max(levels.size(), more.size()));
    for (std::size_t depth = 0; depth < more.size(); ++depth)
        levels[depth].planes += more[depth].planes;
}

void merge(const BuildPhases &more, BuildPhases &phases) {
    phases.directions_s += more.directions_s;
    phases.estimates_s += more.estimates_s;
    phases.sweeps_s += more.sweeps_s;
    phases.partition_s += more.partition_s;
}

class Builder {
public:
    Builder(const TriangleSet &set, const Settings &settings, BuildMonitor *monitor, PlaneSurvey *survey)
        : m_set(set), m_settings(settings), m_source(make_split_source(settings)),
          m_triangle_planes(settings.tree == TreeKind::ize), m_plane_tolerance(plane_tolerance(set.bounds)),
          m_monitor(monitor), m_survey(survey), m_max_depth(depth_allowed(settings, set.size())) {}

    Tree build() const {
        Tree tree;
        tree.box = root_box(m_set);
        NodeWork root{make_references(m_set), Cell(tree.box)};
        if (m_triangle_planes)
            root.references = in_spatial_order(root.references);
        root.bad_refines = m_settings.bad_refines;
        root.budget = m_settings.max_references * double(root.references.size());
        root.seed = m_settings.seed;
        tree.plane_tolerance = m_triangle_planes ? m_plane_tolerance : 0;
        tree.sah_cost = build_node(std::move(root), tree);
        return tree;
    }

private:
    /// Appends the subtree to `tree` and returns its price relative to a ray that meets the node's cell.
    double build_node(NodeWork node, Tree &tree) const {
        if (m_monitor)
            m_monitor->check();
        const double leaf_price = m_settings.cost.leaf_price(node.references.size());
        std::optional<Split> split;
        if (may_split(node, leaf_price, tree))
            split = choose_split(node, tree);
        if (!split || (split->price >= leaf_price && (--node.bad_refines < 0 || is_hopeless(*split, node))))
            return add_leaf(node, leaf_price, tree);
        if (double(split->plane.below) + split->plane.above > node.budget) {
            count_capped(node.references.size(), tree);
            return add_leaf(node, leaf_price, tree);
        }
        auto cells = node.cell.split(split->direction, split->plane.offset);
        if (!cells)
            return add_leaf(node, leaf_price, tree);

        const double area = node.cell.area(), area_below = cells->first.area(), area_above = cells->second.area();
        auto [below, above] = make_children(node, *split, std::move(*cells), tree);
        const std::vector<std::uint32_t> ids = std::move(node.references.ids);
        node.references = {};

        const std::size_t start = tree.nodes.size(), first_reference = tree.references.size();
        const std::size_t capped = tree.capped_leaves, capped_references = tree.capped_references;
        tree.nodes.push_back({split->kind, split->direction, split->plane.offset, 0, 0, 0});
        const auto [price_below, price_above] = build_children(std::move(below), std::move(above), start, tree);
        const double price =
            step_price(node.depth, split->kind) + (area_below * price_below + area_above * price_above) / area;
        if (price < leaf_price || !m_settings.retract)
            return price;
        tree.nodes.resize(start); // the splits never paid: a leaf after all
        tree.references.resize(first_reference);
        const bool was_capped = tree.capped_leaves > capped;
        tree.capped_leaves = capped;
        tree.capped_references = capped_references;
        if (was_capped) // one leaf in the place of them all
            count_capped(ids.size(), tree);
        append_leaf(ids, tree);
        return leaf_price;
    }

    bool may_split(const NodeWork &node, double leaf_price, Tree &tree) const {
        const bool may_pay =
            !m_settings.retract ||
            leaf_price > node_price(node.depth) + std::min(m_settings.cost.axis_cost, m_settings.cost.oblique_cost);
        if (!may_pay || node.references.size() <= std::size_t(m_settings.leaf_size))
            return false;
        if (node.depth < m_max_depth)
            return true;
        count_capped(node.references.size(), tree);
        return false;
    }

    static void count_capped(std::size_t references, Tree &tree) {
        ++tree.capped_leaves;
        tree.capped_references += references;
    }

    /// Bad splits are mended by retracting them; where that is off, the rule of the published code keeps the worst out.
    bool is_hopeless(const Split &split, const NodeWork &node) const {
        const double count = double(node.references.size());
        return !m_settings.retract && count < 16 && split.price > 4 * m_settings.cost.intersection_cost * count;
    }

    double add_leaf(const NodeWork &node, double price, Tree &tree) const {
        append_leaf(node.references.ids, tree);
        if (m_monitor)
            m_monitor->finish(node.share);
        return price;
    }

    static void append_leaf(const std::vector<std::uint32_t> &ids, Tree &tree) {
        TreeNode leaf;
        leaf.first = std::uint32_t(tree.references.size());
        leaf.count = std::uint32_t(ids.size());
        tree.references.insert(tree.references.end(), ids.begin(), ids.end());
        std::sort(tree.references.begin() + leaf.first, tree.references.end());
        tree.nodes.push_back(leaf);
    }

    /// What the first plane of every node of the layout costs besides the plane.
    double node_price(int depth) const {
        const bool is_root = m_settings.layout == LayoutKind::wide && depth % wide_levels == 0;
        return is_root ? m_settings.cost.node_cost : 0;
    }

    double step_price(int depth, TreeNode::Kind kind) const {
        const bool is_axis = kind == TreeNode::Kind::axis;
        return node_price(depth) + (is_axis ? m_settings.cost.axis_cost : m_settings.cost.oblique_cost);
    }

    /// The directions a node may be cut along; the one place where the axes policy is applied.
    std::vector<Direction> directions_of(const NodeWork &node) const {
        std::vector<Direction> directions;
        int wanted = m_settings.k;
        if (m_settings.axes != AxesPolicy::none) {
            for (std::uint8_t axis = 0; axis < 3; ++axis)
                directions.push_back({axis, 0, 0});
            wanted -= 3;
        }
        if (m_source && wanted > 0) {
            for (const Direction &direction : m_source->directions({m_set, node.references}, wanted, Random(node.seed)))
                if (!direction.is_axis() || m_settings.axes == AxesPolicy::none)
                    directions.push_back(direction);
        }
        return directions;
    }

    TreeNode::Kind kind_of(const Direction &direction) const {
        return direction.is_axis() && m_settings.axes == AxesPolicy::fast ? TreeNode::Kind::axis
                                                                          : TreeNode::Kind::oblique;
    }

    /// The cheapest plane of all directions; ties go to the direction listed first.
    std::optional<Split> choose_split(const NodeWork &node, Tree &tree) const {
        std::vector<Direction> directions;
        {
            const Stopwatch stopwatch(tree.phases.directions_s);
            directions = directions_of(node);
        }
        const double leaf_price = m_settings.cost.leaf_price(node.references.size());
        if (!m_triangle_planes && is_large(node)) {
            const std::optional<Split> likely = cheapest_estimate(directions, node, tree);
            if (likely && likely->price < leaf_price) {
                const std::optional<Split> split = cheapest_sweep({likely->direction}, node, tree);
                if (split && split->price < leaf_price)
                    return split;
            }
        }
        return cheapest_sweep(directions, node, tree);
    }

    std::optional<Split> cheapest_estimate(const std::vector<Direction> &directions, const NodeWork &node,
                                           Tree &tree) const {
        const Stopwatch stopwatch(tree.phases.estimates_s);
        count_planes(node.depth, directions.size() * estimated_planes, tree);
        return cheapest_of(directions, node, [&](const Direction &direction) {
            return estimate(node.references, node.cell, direction, m_settings.cost);
        });
    }

    std::optional<Split> cheapest_sweep(const std::vector<Direction> &directions, const NodeWork &node,
                                        Tree &tree) const {
        const Stopwatch stopwatch(tree.phases.sweeps_s);
        const std::size_t along_triangles = m_triangle_planes ? 4 * tried_triangles(node) : 0;
        count_planes(node.depth, 2 * directions.size() * node.references.size() + along_triangles, tree);
        if (m_survey && m_triangle_planes)
            for (const std::uint32_t id : node.references.ids)
                for (const TrianglePlane &plane : planes_along(m_set.triangles[id])) // such trees have no primitives
                    m_survey->add(node.depth, plane.direction, {plane.offset});
        return cheapest_of(directions, node, [&](const Direction &direction) {
            std::vector<float> offsets;
            const auto plane =
                sweep(node.references, node.cell, direction, m_settings.cost, m_survey ? &offsets : nullptr);
            if (m_survey)
                m_survey->add(node.depth, direction, offsets);
            return plane;
        });
    }

    static void count_planes(int depth, std::size_t count, Tree &tree) {
        tree.levels.resize(std::max(tree.levels.size(), std::size_t(depth) + 1));
        tree.levels[std::size_t(depth)].planes += count;
    }

    template <typename PriceDirection>
    std::optional<Split> cheapest_of(const std::vector<Direction> &directions, const NodeWork &node,
                                     const PriceDirection &price_direction) const {
        std::vector<std::optional<SweptPlane>> planes(directions.size());
        const auto price_range = [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                if (m_monitor)
                    m_monitor->check();
                planes[i] = price_direction(directions[i]);
            }
        };
        if (node.references.size() >= parallel_sweep_size)
            parallel_for(directions.size(), 1, price_range);
        else
            price_range(0, directions.size());

        const double count = double(node.references.size());
        const CostModel &cost = m_settings.cost;
        const double surcharge = cost.alpha * cost.intersection_cost * (count - 1);
        const bool by_size = cost.oblique_price != ObliquePrice::constant;
        const double axis_price = step_price(node.depth, TreeNode::Kind::axis);
        const double true_price = step_price(node.depth, TreeNode::Kind::oblique);
        const double base = cost.oblique_price == ObliquePrice::linear ? axis_price : true_price;
        const auto attempt = [&](double oblique_price) {
            const std::optional<Split> swept = cheapest(directions, planes, axis_price, oblique_price);
            return m_triangle_planes ? or_triangle_plane(node, swept, oblique_price) : swept;
        };
        std::optional<Split> split = attempt(by_size ? base + surcharge : true_price);
        // A price that grows with the node keeps oblique planes to where they gain much; where it lets nothing beat the
        // leaf, they are tried again at their true price (Ize, Wald, Parker 2008).
        if (by_size && cost.retry && (!split || split->price >= cost.leaf_price(node.references.size())))
            split = attempt(true_price);
        return split;
    }

    std::optional<Split> cheapest(const std::vector<Direction> &directions,
                                  const std::vector<std::optional<SweptPlane>> &planes, double axis_price,
                                  double oblique_price) const {
        std::optional<Split> best;
        for (std::size_t i = 0; i < directions.size(); ++i) {
            if (!planes[i])
                continue;
            const TreeNode::Kind kind = kind_of(directions[i]);
            const double step = kind == TreeNode::Kind::axis ? axis_price : oblique_price;
            const double price = step + planes[i]->cost;
            if (!best || price < best->price)
                best = Split{kind, directions[i], *planes[i], price};
        }
        return best;
    }

    bool is_large(const NodeWork &node) const { return node.references.size() > std::size_t(m_settings.exact_below); }

    /// How many of a node's triangles have the planes along them tried.
    std::size_t tried_triangles(const NodeWork &node) const {
        return is_large(node) ? std::min(node.references.size(), most_tried) : node.references.size();
    }

    /// `swept`, or a plane along a triangle where that is cheaper.
    std::optional<Split> or_triangle_plane(const NodeWork &node, const std::optional<Split> &swept,
                                           double oblique_price) const {
        const double limit = swept ? swept->price - oblique_price : HUGE_VAL;
        const auto found = best_triangle_plane(m_set, node.references, node.cell, m_settings.cost, m_plane_tolerance,
                                               limit, tried_triangles(node));
        if (!found)
            return swept;
        return Split{TreeNode::Kind::oblique, found->direction, found->plane, oblique_price + found->plane.cost};
    }

    std::pair<NodeWork, NodeWork> make_children(const NodeWork &node, const Split &split, std::pair<Cell, Cell> cells,
                                                Tree &tree) const {
        const Stopwatch stopwatch(tree.phases.partition_s);
        auto [below, above] = split_references(node.references, split.direction, split.plane, m_settings.clip);
        const double total = std::max(1.0, double(below.size() + above.size()));
        const auto child = [&](ReferenceList references, Cell cell, bool is_above) {
            const double part = double(references.size()) / total;
            return NodeWork{std::move(references),
                            std::move(cell),
                            node.depth + 1,
                            node.bad_refines,
                            node.budget * part,
                            node.share * part,
                            child_seed(node.seed, is_above)};
        };
        return {child(std::move(below), std::move(cells.first), false),
                child(std::move(above), std::move(cells.second), true)};
    }

    std::pair<double, double> build_children(NodeWork below, NodeWork above, std::size_t parent, Tree &tree) const {
        double price_below = 0, price_above = 0;
        if (std::min(below.references.size(), above.references.size()) < parallel_subtree_size) {
            price_below = build_node(std::move(below), tree);
            tree.nodes[parent].above = std::uint32_t(tree.nodes.size());
            price_above = build_node(std::move(above), tree);
        } else {
            Tree part_below, part_above;
            parallel_invoke([&] { price_below = build_node(std::move(below), part_below); },
                            [&] { price_above = build_node(std::move(above), part_above); });
            append(part_below, tree);
            tree.nodes[parent].above = std::uint32_t(tree.nodes.size());
            append(part_above, tree);
        }
        return {price_below, price_above};
    }

    static void append(const Tree &part, Tree &tree) {
        merge(part.levels, tree.levels);
        merge(part.phases, tree.phases);
        tree.capped_leaves += part.capped_leaves;
        tree.capped_references += part.capped_references;
        const std::uint32_t node_shift = std::uint32_t(tree.nodes.size());
        const std::uint32_t reference_shift = std::uint32_t(tree.references.size());
        for (TreeNode node : part.nodes) {
            (node.kind == TreeNode::Kind::leaf ? node.first : node.above) +=
                node.kind == TreeNode::Kind::leaf ? reference_shift : node_shift;
            tree.nodes.push_back(node);
        }
        tree.references.insert(tree.references.end(), part.references.begin(), part.references.end());
    }

    const TriangleSet &m_set;
    const Settings m_settings;
    const std::unique_ptr<SplitSource> m_source;
    const bool m_triangle_planes;
    const double m_plane_tolerance;
    BuildMonitor *const m_monitor;
    PlaneSurvey *const m_survey;
    const int m_max_depth;
};

/// `use(triangles, axes)`, with the triangles as they are seen in the tree's axes.
template <typename Use> auto in_own_axes(const TriangleSet &set, const Settings &settings, const Use &use) {
    if (settings.orientation == OrientationKind::scene)
        if (const Orientation found = find_orientation(set); found.turns())
            return use(found.seen(set), found);
    return use(set, Orientation());
}

} // namespace

int depth_allowed(const Settings &settings, std::size_t triangles) {
    if (settings.max_depth > 0)
        return settings.max_depth;
    const double count = std::max<double>(1, double(triangles));
    return std::min(depth_limit, int(std::round(settings.depth_margin + 1.6 * std::log2(count))));
}

Bounds root_box(const TriangleSet &set) {
    Bounds box = set.bounds;
    if (box.empty())
        return {{0, 0, 0}, {0, 0, 0}};
    const Vec3d size = box.upper - box.lower;
    const double margin = 1e-5 * std::max({size.x, size.y, size.z});
    for (std::size_t axis = 0; axis < 3; ++axis) {
        // At large coordinates a float step is the least that makes a difference.
        const double step = 0x1p-22 * std::max(std::abs(box.lower[axis]), std::abs(box.upper[axis]));
        box.lower[axis] -= std::max(margin, step);
        box.upper[axis] += std::max(margin, step);
    }
    return box;
}

Tree build_tree(const TriangleSet &set, const Settings &settings, BuildMonitor *monitor) {
    const StandardFloats floats;
    return in_own_axes(set, settings, [&](const TriangleSet &seen, const Orientation &orientation) {
        Tree tree = Builder(seen, settings, monitor, nullptr).build();
        tree.orientation = orientation;
        describe_levels(tree);
        return tree;
    });
}

std::vector<LevelPlanes> survey_planes(const TriangleSet &set, const Settings &settings, BuildMonitor *monitor) {
    const StandardFloats floats;
    PlaneSurvey survey;
    in_own_axes(set, settings, [&](const TriangleSet &seen, const Orientation &) {
        Builder(seen, settings, monitor, &survey).build();
    });
    return survey.counts();
}

} // namespace bsp
