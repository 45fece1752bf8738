/// What users of the library see: something that answers rays, whatever is inside.
#pragma once

#include <memory>
#include <string>

#include "ray.h"
#include "settings.h"
#include "tree.h"
#include "triangles.h"

namespace bsp {

/// The points p with normal . p = offset.
struct Plane {
    Vec3f normal; ///< its largest component is 1
    float offset;
};

/// Some of the bytes that an accelerator reads while it answers.
struct MemoryPart {
    const void *data;
    std::size_t size;
};

/// What a tree is made of. Zero for brute force where it does not apply.
struct Statistics {
    std::string spec;
    std::size_t triangles = 0, dropped_triangles = 0;
    std::size_t nodes = 0, interior_nodes = 0, axis_nodes = 0, oblique_nodes = 0;
    std::size_t leaves = 0, empty_leaves = 0, references = 0;
    int max_depth = 0;
    std::size_t bytes = 0;
    double sah_cost = 0;
    double build_s = 0;
};

/// Answers rays about a fixed set of triangles. All queries may be made from many threads at once and never throw. A
/// ray with a component that is not finite, or without direction, hits nothing.
class Accelerator {
public:
    virtual ~Accelerator() = default;

    virtual Hit closest(const Ray &ray) const noexcept = 0;
    virtual bool any(const Ray &ray) const noexcept = 0;
    virtual Hit count_closest(const Ray &ray, Counters &counters) const noexcept = 0;
    virtual bool count_any(const Ray &ray, Counters &counters) const noexcept = 0;

    /// All split planes, in the order of the nodes; none for brute force.
    virtual std::vector<Plane> planes() const = 0;
    /// Nodes and triangles, byte by byte the same for equal input and settings.
    virtual std::vector<MemoryPart> memory() const = 0;

    const Statistics &statistics() const { return m_statistics; }
    const Bounds &bounds() const { return m_bounds; } ///< of the triangles; empty if there are none

protected:
    Statistics m_statistics;
    Bounds m_bounds;
};

/// Builds what the settings say. The set may be destroyed afterwards. Throws std::bad_alloc or std::length_error.
std::unique_ptr<Accelerator> make_accelerator(const TriangleSet &set, const Settings &settings);

} // namespace bsp
