#include "statistics.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace bsp {

void describe_tree(const Tree &tree, Statistics &s) {
    s.nodes = tree.nodes.size();
    constexpr std::size_t largest_size_listed = 32;
    s.leaf_sizes.assign(largest_size_listed + 1, 0);
    for (const TreeNode &node : tree.nodes)
        if (node.kind == TreeNode::Kind::leaf)
            ++s.leaf_sizes[std::min<std::size_t>(node.count, largest_size_listed)];
    s.levels = tree.levels;
    for (const LevelCounts &level : tree.levels) {
        s.axis_nodes += level.axis_nodes;
        s.oblique_nodes += level.oblique_nodes;
        s.leaves += level.leaves;
    }
    s.empty_leaves = s.leaf_sizes[0];
    s.interior_nodes = s.nodes - s.leaves;
    s.references = tree.references.size();
    s.capped_leaves = tree.capped_leaves;
    s.capped_references = tree.capped_references;
    s.max_depth = tree.depth;
    s.sah_cost = tree.sah_cost;
    s.phases = tree.phases;
}

namespace {

/// Writes the members of an object one after the other.
class JsonObject {
public:
    explicit JsonObject(std::ostream &out) : m_out(out) { m_out << "{"; }
    ~JsonObject() { m_out << "}"; }
    JsonObject(const JsonObject &) = delete;
    JsonObject &operator=(const JsonObject &) = delete;

    template <typename T> void add(const char *name, const T &value) {
        key(name);
        write(value);
    }

private:
    void key(const char *name) {
        m_out << (m_first ? "" : ", ") << '"' << name << "\": ";
        m_first = false;
    }

    void write(std::size_t value) { m_out << value; }
    void write(int value) { m_out << value; }
    void write(bool value) { m_out << (value ? "true" : "false"); }
    void write(const std::string &value) { m_out << std::quoted(value); }
    void write(double value) { // JSON has no word for what is not finite
        if (std::isfinite(value))
            m_out << value;
        else
            m_out << "null";
    }
    template <typename T> void write(const std::vector<T> &values) {
        m_out << "[";
        for (std::size_t i = 0; i < values.size(); ++i) {
            m_out << (i > 0 ? ", " : "");
            write(values[i]);
        }
        m_out << "]";
    }
    void write(const LevelCounts &level) {
        JsonObject object(m_out);
        object.add("axis_nodes", level.axis_nodes);
        object.add("oblique_nodes", level.oblique_nodes);
        object.add("leaves", level.leaves);
        object.add("references", level.references);
        object.add("planes", level.planes);
    }
    void write(const BuildPhases &phases) {
        JsonObject object(m_out);
        object.add("directions", phases.directions_s);
        object.add("estimates", phases.estimates_s);
        object.add("sweeps", phases.sweeps_s);
        object.add("partition", phases.partition_s);
        object.add("pack", phases.pack_s);
    }

    std::ostream &m_out;
    bool m_first = true;
};

} // namespace

std::string to_json(const Statistics &s) {
    std::ostringstream out;
    {
        JsonObject object(out);
        object.add("spec", s.spec);
        object.add("chosen", s.chosen);
        object.add("choice", s.choice);
        object.add("precision", s.precision);
        object.add("choose_s", s.choose_s);
        object.add("predicted_build_s", s.predicted_build_s);
        object.add("predicted_trace_s", s.predicted_trace_s);
        object.add("triangles", s.triangles);
        object.add("dropped_triangles", s.dropped_triangles);
        object.add("primitives", s.primitives);
        object.add("nodes", s.nodes);
        object.add("interior_nodes", s.interior_nodes);
        object.add("axis_nodes", s.axis_nodes);
        object.add("oblique_nodes", s.oblique_nodes);
        object.add("leaves", s.leaves);
        object.add("empty_leaves", s.empty_leaves);
        object.add("capped_leaves", s.capped_leaves);
        object.add("capped_references", s.capped_references);
        object.add("references", s.references);
        object.add("max_depth", s.max_depth);
        object.add("bytes", s.bytes);
        object.add("sah_cost", s.sah_cost);
        object.add("build_s", s.build_s);
        object.add("loaded", s.loaded);
        object.add("phases_s", s.phases);
        object.add("leaf_sizes", s.leaf_sizes);
        object.add("levels", s.levels);
    }
    return out.str();
}

} // namespace bsp
