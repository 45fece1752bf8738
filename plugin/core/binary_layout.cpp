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
                                " is above 2^26; raise leaf_size or lower max_references");
    return std::uint32_t(index);
}

/// The directions of a tree's oblique nodes if they are few, compared with their nodes and with `max_families`.
std::vector<Direction> find_families(const Tree &tree) {
    constexpr std::size_t nodes_per_family = 8; // a ray meets few nodes; a family it does not meet costs it time
    std::vector<Direction> families;
    std::size_t oblique_nodes = 0;
    for (const TreeNode &node : tree.nodes) {
        if (node.kind != TreeNode::Kind::oblique)
            continue;
        ++oblique_nodes;
        if (std::find(families.begin(), families.end(), node.direction) == families.end())
            families.push_back(node.direction);
        if (families.size() > NodeWord::max_families)
            return {};
    }
    return oblique_nodes >= nodes_per_family * families.size() ? families : std::vector<Direction>{};
}

Splits splits_of(const Tree &tree, const std::vector<Direction> &families) {
    const bool oblique = std::any_of(tree.nodes.begin(), tree.nodes.end(), [](const TreeNode &node) {
        return node.kind != TreeNode::Kind::leaf && !node.direction.is_axis();
    });
    return !oblique ? Splits::axes : families.empty() ? Splits::planes : Splits::families;
}

/// Writes the interior nodes of a tree.
class NodeWriter {
public:
    NodeWriter(const Tree &tree, BinaryLayout &layout) : m_layout(layout), m_word_of(tree.nodes.size()) {
        std::size_t words = 0, blocks = 0;
        for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
            m_word_of[i] = words;
            words += is_double(tree.nodes[i]) ? 2 : 1;
            blocks += (tree.nodes[i].count + TriangleBlock::width - 1) / TriangleBlock::width;
        }
        m_layout.words.reserve(words);
        m_layout.blocks.reserve(blocks);
    }

    void write(const TreeNode &node) {
        const std::uint32_t above = checked_index(m_word_of[node.above]);
        m_layout.words.push_back(NodeWord::interior(kind_of(node), node.offset, above));
        if (is_double(node))
            m_layout.words.push_back(NodeWord::slopes(node.direction.a, node.direction.b));
    }

private:
    bool is_double(const TreeNode &node) const {
        return node.kind == TreeNode::Kind::oblique && m_layout.splits == Splits::planes;
    }

    std::uint32_t kind_of(const TreeNode &node) const {
        if (node.kind == TreeNode::Kind::axis || m_layout.splits == Splits::axes)
            return axis_kinds[node.direction.major];
        if (m_layout.splits == Splits::planes)
            return oblique_kinds[node.direction.major];
        const auto &families = m_layout.families;
        return NodeWord::family +
               std::uint32_t(std::find(families.begin(), families.end(), node.direction) - families.begin());
    }

    BinaryLayout &m_layout;
    std::vector<std::size_t> m_word_of;
};

} // namespace

Box packed_box(const Tree &tree) {
    Box box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        box.lower[axis] = round_down(tree.box.lower[axis]);
        box.upper[axis] = round_up(tree.box.upper[axis]);
    }
    return box;
}

float packed_tolerance(const Tree &tree) { return round_up(tree.plane_tolerance); }

void add_blocks(const std::uint32_t *ids, std::size_t count, const TriangleSet &set,
                LargePageVector<TriangleBlock> &blocks) {
    for (std::size_t i = 0; i < count; i += TriangleBlock::width) {
        TriangleBlock block;
        for (unsigned lane = 0; lane < TriangleBlock::width && i + lane < count; ++lane)
            if (const std::uint32_t id = ids[i + lane]; is_primitive(id))
                block.set(lane, PrimitiveBox(set.primitives[primitive_index(id)]), id);
            else
                block.set(lane, set.triangles[id], id);
        blocks.push_back(block);
    }
}

BinaryLayout pack_binary(const Tree &tree, const TriangleSet &set, bool families) {
    BinaryLayout layout;
    layout.orientation = tree.orientation;
    layout.box = packed_box(tree);
    if (families)
        layout.families = find_families(tree);
    layout.splits = splits_of(tree, layout.families);
    layout.plane_tolerance = packed_tolerance(tree);
    NodeWriter writer(tree, layout);
    for (const TreeNode &node : tree.nodes) {
        if (node.kind == TreeNode::Kind::leaf) {
            const std::uint32_t *ids = tree.references.data() + node.first;
            layout.words.push_back(NodeWord::make_leaf(checked_index(layout.blocks.size()), node.count));
            add_blocks(ids, node.count, set, layout.blocks);
        } else {
            writer.write(node);
        }
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
        if (word.is_family()) {
            direction = layout.families[word.family_index()];
        } else if (!word.is_axis()) {
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
