#include "builder.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "cell.h"
#include "parallel.h"
#include "reference_hierarchy.h"
#include "references.h"
#include "split_source.h"
#include "sweep.h"
#include "triangle_planes.h"

namespace bsp {
namespace {

constexpr std::size_t parallel_sweep_size = 1 << 15;   ///< from here on, directions are swept by different threads
constexpr std::size_t parallel_subtree_size = 1 << 11; ///< from here on, children are built by different threads

/// The part of the tree below one node while it is being built.
struct NodeWork {
    ReferenceList references;
    Cell cell;
    int depth = 0;
    int bad_refines = 0; ///< splits dearer than their leaf that may still follow
    double budget = 0;   ///< references the leaves below may list together
    std::uint64_t seed = 0;
};

struct Split {
    TreeNode::Kind kind = TreeNode::Kind::axis;
    Direction direction;
    SweptPlane plane;
    double price = HUGE_VAL; ///< of the step and the children's triangles
};

class Builder {
public:
    Builder(const TriangleSet &set, const Settings &settings)
        : m_set(set), m_settings(settings), m_source(make_split_source(settings.tree)),
          m_triangle_planes(settings.tree == TreeKind::ize), m_plane_tolerance(plane_tolerance(set.bounds)) {
        const double count = std::max<double>(1, double(set.valid.size()));
        m_max_depth = settings.max_depth > 0 ? settings.max_depth
                                             : std::min(depth_limit, int(std::round(8 + 1.6 * std::log2(count))));
    }

    Tree build() const {
        NodeWork root{make_references(m_set), Cell(root_box(m_set))};
        if (m_triangle_planes)
            root.references = in_spatial_order(root.references);
        root.bad_refines = m_settings.bad_refines;
        root.budget = m_settings.max_references * double(root.references.size());
        root.seed = m_settings.seed;
        Tree tree;
        tree.plane_tolerance = m_triangle_planes ? m_plane_tolerance : 0;
        tree.sah_cost = build_node(std::move(root), tree);
        return tree;
    }

private:
    /// Appends the subtree to `tree` and returns its price relative to a ray that meets the node's cell.
    double build_node(NodeWork node, Tree &tree) const {
        const double leaf_price = m_settings.cost.intersection_cost * double(node.references.size());
        std::optional<Split> split;
        const bool may_pay = leaf_price > std::min(m_settings.cost.axis_cost, m_settings.cost.oblique_cost);
        if (may_pay && node.references.size() > std::size_t(m_settings.leaf_size) && node.depth < m_max_depth)
            split = choose_split(node);
        if (!split || double(split->plane.below) + split->plane.above > node.budget)
            return add_leaf(node.references.ids, leaf_price, tree);
        if (split->price >= leaf_price && --node.bad_refines < 0)
            return add_leaf(node.references.ids, leaf_price, tree);
        auto cells = node.cell.split(split->direction, split->plane.offset);
        if (!cells)
            return add_leaf(node.references.ids, leaf_price, tree);

        const double area = node.cell.area(), area_below = cells->first.area(), area_above = cells->second.area();
        auto [below, above] = make_children(node, *split, std::move(*cells));
        const std::vector<std::uint32_t> ids = std::move(node.references.ids);
        node.references = {};

        const std::size_t start = tree.nodes.size(), first_reference = tree.references.size();
        tree.nodes.push_back({split->kind, split->direction, split->plane.offset, 0, 0, 0});
        const auto [price_below, price_above] = build_children(std::move(below), std::move(above), start, tree);
        const double price = step_price(split->kind) + (area_below * price_below + area_above * price_above) / area;
        if (price < leaf_price)
            return price;
        tree.nodes.resize(start); // the splits never paid: a leaf after all
        tree.references.resize(first_reference);
        return add_leaf(ids, leaf_price, tree);
    }

    double add_leaf(const std::vector<std::uint32_t> &ids, double price, Tree &tree) const {
        TreeNode leaf;
        leaf.first = std::uint32_t(tree.references.size());
        leaf.count = std::uint32_t(ids.size());
        tree.references.insert(tree.references.end(), ids.begin(), ids.end());
        std::sort(tree.references.begin() + leaf.first, tree.references.end());
        tree.nodes.push_back(leaf);
        return price;
    }

    double step_price(TreeNode::Kind kind) const {
        return kind == TreeNode::Kind::axis ? m_settings.cost.axis_cost : m_settings.cost.oblique_cost;
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
            const NodeTriangles triangles{m_set, node.references.ids.data(), node.references.size()};
            for (const Direction &direction : m_source->directions(triangles, wanted, Random(node.seed)))
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
    std::optional<Split> choose_split(const NodeWork &node) const {
        const std::vector<Direction> directions = directions_of(node);
        std::vector<std::optional<SweptPlane>> planes(directions.size());
        const auto sweep_range = [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                planes[i] = sweep(node.references, node.cell, directions[i], m_settings.cost);
        };
        if (node.references.size() >= parallel_sweep_size)
            parallel_for(directions.size(), 1, sweep_range);
        else
            sweep_range(0, directions.size());

        const double count = double(node.references.size());
        const CostModel &cost = m_settings.cost;
        const double surcharge = cost.alpha * cost.intersection_cost * (count - 1);
        const bool by_size = cost.oblique_price != ObliquePrice::constant;
        const double base = cost.oblique_price == ObliquePrice::linear ? cost.axis_cost : cost.oblique_cost;
        const auto attempt = [&](double oblique_price) {
            const std::optional<Split> swept = cheapest(directions, planes, oblique_price);
            return m_triangle_planes ? or_triangle_plane(node, swept, oblique_price) : swept;
        };
        std::optional<Split> split = attempt(by_size ? base + surcharge : cost.oblique_cost);
        // A price that grows with the node keeps oblique planes to where they gain much; where it lets nothing beat the
        // leaf, they are tried again at their true price (Ize, Wald, Parker 2008).
        if (by_size && (!split || split->price >= cost.intersection_cost * count))
            split = attempt(cost.oblique_cost);
        return split;
    }

    std::optional<Split> cheapest(const std::vector<Direction> &directions,
                                  const std::vector<std::optional<SweptPlane>> &planes, double oblique_price) const {
        std::optional<Split> best;
        for (std::size_t i = 0; i < directions.size(); ++i) {
            if (!planes[i])
                continue;
            const TreeNode::Kind kind = kind_of(directions[i]);
            const double step = kind == TreeNode::Kind::axis ? m_settings.cost.axis_cost : oblique_price;
            const double price = step + planes[i]->cost;
            if (!best || price < best->price)
                best = Split{kind, directions[i], *planes[i], price};
        }
        return best;
    }

    /// `swept`, or a plane along a triangle where that is cheaper.
    std::optional<Split> or_triangle_plane(const NodeWork &node, const std::optional<Split> &swept,
                                           double oblique_price) const {
        const double limit = swept ? swept->price - oblique_price : HUGE_VAL;
        const auto found =
            best_triangle_plane(m_set, node.references, node.cell, m_settings.cost, m_plane_tolerance, limit);
        if (!found)
            return swept;
        return Split{TreeNode::Kind::oblique, found->direction, found->plane, oblique_price + found->plane.cost};
    }

    std::pair<NodeWork, NodeWork> make_children(const NodeWork &node, const Split &split,
                                                std::pair<Cell, Cell> cells) const {
        auto [below, above] = split_references(node.references, split.direction, split.plane);
        const double total = std::max(1.0, double(below.size() + above.size()));
        const double share_below = node.budget * double(below.size()) / total;
        const double share_above = node.budget * double(above.size()) / total;
        return {NodeWork{std::move(below), std::move(cells.first), node.depth + 1, node.bad_refines, share_below,
                         child_seed(node.seed, false)},
                NodeWork{std::move(above), std::move(cells.second), node.depth + 1, node.bad_refines, share_above,
                         child_seed(node.seed, true)}};
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
    int m_max_depth;
};

int depth_of(const Tree &tree) {
    std::vector<int> depth(tree.nodes.size(), 0);
    int deepest = 0;
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
        if (tree.nodes[i].kind == TreeNode::Kind::leaf)
            continue;
        depth[i + 1] = depth[tree.nodes[i].above] = depth[i] + 1;
        deepest = std::max(deepest, depth[i] + 1);
    }
    return deepest;
}

} // namespace

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

Tree build_tree(const TriangleSet &set, const Settings &settings) {
    const StandardFloats floats;
    Tree tree = Builder(set, settings).build();
    tree.depth = depth_of(tree);
    return tree;
}

} // namespace bsp
