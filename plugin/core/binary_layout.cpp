#include "binary_layout.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "builder.h"
#include "sorting.h"

namespace bsp {
namespace {

constexpr NodeWord::Kind axis_kinds[3] = {NodeWord::axis_x, NodeWord::axis_y, NodeWord::axis_z};
constexpr NodeWord::Kind oblique_kinds[3] = {NodeWord::oblique_x, NodeWord::oblique_y, NodeWord::oblique_z};

std::uint32_t checked_index(std::size_t index) {
    if (index > NodeWord::max_index)
        throw std::length_error("the tree is too large for its node format: " + std::to_string(index) +
                                " is above 2^29; raise leaf_size or lower max_references");
    return std::uint32_t(index);
}

/// Appends a leaf's triangles as blocks; returns the first.
std::uint32_t add_blocks(const std::uint32_t *ids, std::size_t count, const TriangleSet &set,
                         std::vector<TriangleBlock> &blocks) {
    const std::uint32_t first = checked_index(blocks.size());
    for (std::size_t i = 0; i < count; i += TriangleBlock::width) {
        TriangleBlock block{};
        for (unsigned lane = 0; lane < TriangleBlock::width; ++lane)
            if (i + lane < count)
                block.set(lane, set.triangles[ids[i + lane]], ids[i + lane]);
            else
                block.set(lane, Triangle{}, no_triangle);
        blocks.push_back(block);
    }
    return first;
}

} // namespace

BinaryLayout pack_binary(const Tree &tree, const TriangleSet &set) {
    BinaryLayout layout;
    const Bounds root = root_box(set);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        layout.box.lower[axis] = round_down(root.lower[axis]);
        layout.box.upper[axis] = round_up(root.upper[axis]);
    }
    layout.has_oblique = std::any_of(tree.nodes.begin(), tree.nodes.end(), [](const TreeNode &node) {
        return node.kind != TreeNode::Kind::leaf && !node.direction.is_axis();
    });
    layout.plane_tolerance = round_up(tree.plane_tolerance);
    const auto is_wide = [&](const TreeNode &node) {
        return node.kind == TreeNode::Kind::oblique && layout.has_oblique;
    };

    std::vector<std::size_t> word_of(tree.nodes.size());
    std::size_t word_count = 0;
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
        word_of[i] = word_count;
        word_count += is_wide(tree.nodes[i]) ? 2 : 1;
    }
    layout.words.reserve(word_count);
    for (const TreeNode &node : tree.nodes) {
        if (node.kind == TreeNode::Kind::leaf) {
            const std::uint32_t *ids = tree.references.data() + node.first;
            layout.words.push_back(NodeWord::make_leaf(add_blocks(ids, node.count, set, layout.blocks), node.count));
            continue;
        }
        const auto &kinds = is_wide(node) ? oblique_kinds : axis_kinds;
        layout.words.push_back(
            NodeWord::interior(kinds[node.direction.major], node.offset, checked_index(word_of[node.above])));
        if (is_wide(node))
            layout.words.push_back(NodeWord::slopes(node.direction.a, node.direction.b));
    }
    return layout;
}

std::vector<Plane> planes_of(const BinaryLayout &layout) {
    std::vector<Plane> planes;
    for (std::size_t i = 0; i < layout.words.size(); ++i) {
        const NodeWord &word = layout.words[i];
        if (word.is_leaf())
            continue;
        Direction direction{std::uint8_t(word.axis()), 0, 0};
        if (!word.is_axis()) {
            ++i;
            direction.a = layout.words[i].a();
            direction.b = layout.words[i].b();
        }
        const Vec3d n = direction.normal();
        planes.push_back({{float(n.x), float(n.y), float(n.z)}, word.offset()});
    }
    return planes;
}

} // namespace bsp
