/// The binary node layout of the papers: kd nodes of 8 bytes and plane nodes of 16, in depth-first order.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "accelerator.h"
#include "large_pages.h"
#include "tree.h"
#include "triangle_block.h"

namespace bsp {

/// One or two words make a node. Its kind and where its second child (interior) or its first block (leaf) is share 32
/// bits; the child below follows the node. Kinds from `family` on are planes of the layout's families: one word each.
class NodeWord {
public:
    enum Kind : std::uint32_t { axis_x, axis_y, axis_z, leaf, oblique_x, oblique_y, oblique_z, family };
    static constexpr std::uint32_t kind_bits = 6, max_families = (1u << kind_bits) - family;
    static constexpr std::uint32_t max_index = (1u << (32 - kind_bits)) - 1;

    static NodeWord interior(std::uint32_t kind, float offset, std::uint32_t above) {
        NodeWord word;
        word.m_value = offset;
        word.m_bits = above << kind_bits | kind;
        return word;
    }
    static NodeWord make_leaf(std::uint32_t first_block, std::uint32_t triangle_count) {
        NodeWord word;
        std::memcpy(&word.m_value, &triangle_count, sizeof triangle_count);
        word.m_bits = first_block << kind_bits | leaf;
        return word;
    }
    /// The second word of an oblique node.
    static NodeWord slopes(float a, float b) {
        NodeWord word;
        word.m_value = a;
        std::memcpy(&word.m_bits, &b, sizeof b);
        return word;
    }

    std::uint32_t kind() const { return m_bits & ((1u << kind_bits) - 1); }
    bool is_leaf() const { return kind() == leaf; }
    bool is_axis() const { return kind() < leaf; }
    bool is_family() const { return kind() >= family; }
    unsigned axis() const { return m_bits & 3; } ///< of kinds that have one: the values are chosen so
    unsigned family_index() const { return kind() - family; }
    float offset() const { return m_value; }
    std::uint32_t index() const { return m_bits >> kind_bits; } ///< word of the child above, or the leaf's first block
    std::uint32_t triangle_count() const {
        std::uint32_t count;
        std::memcpy(&count, &m_value, sizeof count);
        return count;
    }
    float a() const { return m_value; }
    float b() const {
        float b;
        std::memcpy(&b, &m_bits, sizeof b);
        return b;
    }

private:
    float m_value = 0;
    std::uint32_t m_bits = 0;
};

static_assert(sizeof(NodeWord) == 8);

/// The region of the root, rounded outward.
struct Box {
    Vec3f lower, upper;
};

/// What a tree's interior nodes are: a tree pays only for what it needs, whatever built it.
enum class Splits {
    axes,     ///< axis nodes
    families, ///< axis nodes and planes of few directions, whose dot products are computed once per ray
    planes,   ///< axis nodes and planes of any direction
};

struct BinaryLayout {
    Orientation orientation;
    Box box;
    LargePageVector<NodeWord> words;
    LargePageVector<TriangleBlock> blocks;
    Splits splits = Splits::axes;
    std::vector<Direction> families; ///< of `Splits::families`
    float plane_tolerance = 0; ///< triangles may lie beyond oblique planes by this, as a position along the normal

    std::vector<MemoryPart> memory() const { return {memory_of(words), memory_of(blocks)}; }
};

/// The split planes, in the order of the nodes.
std::vector<Plane> planes_of(const BinaryLayout &layout);

// What every layout takes over from a tree.
Box packed_box(const Tree &tree);
float packed_tolerance(const Tree &tree);
/// Appends a leaf's triangles as blocks.
void add_blocks(const std::uint32_t *ids, std::size_t count, const TriangleSet &set,
                LargePageVector<TriangleBlock> &blocks);

/// Nodes know families of planes where there are few and `families` lets them. Throws std::length_error if the tree
/// does not fit 26-bit indices.
BinaryLayout pack_binary(const Tree &tree, const TriangleSet &set, bool families = true);

} // namespace bsp
