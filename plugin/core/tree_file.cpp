#include "tree_file.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <memory>
#include <random>
#include <stdexcept>
#include <system_error>

#include "hash.h"

namespace bsp {
namespace {

namespace fs = std::filesystem;

constexpr char magic[8] = {'B', 'S', 'P', ' ', 't', 'r', 'e', 'e'};
constexpr std::uint32_t byte_order = 0x01020304;
constexpr std::uint32_t format_version = 5;

/// A file is this, then the nodes, then the references.
struct Header {
    char magic[8];
    std::uint32_t byte_order, format_version;
    std::uint64_t key;
    std::uint64_t node_count, reference_count;
    double axes[3][3], origin[3]; ///< of `Tree::orientation`; all 0 for the user's
    double lower[3], upper[3];    ///< of `Tree::box`
    double sah_cost, plane_tolerance;
    std::uint64_t capped_leaves, capped_references;
    std::uint64_t planes[depth_limit + 1]; ///< per level
    std::uint64_t hash;                    ///< of the whole file, this field taken as 0
};
static_assert(sizeof(Header) == 224 + 8 * (depth_limit + 1));

/// A node as it is in a file: the same bytes for the same tree, which `TreeNode` with its padding is not.
struct SavedNode {
    std::uint8_t kind, major;
    std::uint16_t zero;
    float a, b, offset;
    std::uint32_t link; ///< interior: index of the child above; leaf: number of its triangles
};
static_assert(sizeof(SavedNode) == 20);

void set_view(const Tree &tree, Header &header) {
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < 3 && tree.orientation.turns(); ++k)
            header.axes[i][k] = tree.orientation.axes()[i][k];
        header.origin[i] = tree.orientation.origin()[i];
        header.lower[i] = tree.box.lower[i];
        header.upper[i] = tree.box.upper[i];
    }
}

void get_view(const Header &header, Tree &tree) {
    const auto vector = [](const double (&v)[3]) { return Vec3d{v[0], v[1], v[2]}; };
    const std::array<Vec3d, 3> axes{vector(header.axes[0]), vector(header.axes[1]), vector(header.axes[2])};
    if (!(axes[0] == Vec3d{}))
        tree.orientation = Orientation(axes, vector(header.origin));
    tree.box = {vector(header.lower), vector(header.upper)};
}

bool is_leaf(const SavedNode &node) { return TreeNode::Kind(node.kind) == TreeNode::Kind::leaf; }

std::vector<SavedNode> to_saved(const std::vector<TreeNode> &nodes) {
    std::vector<SavedNode> saved;
    saved.reserve(nodes.size());
    for (const TreeNode &node : nodes)
        saved.push_back({std::uint8_t(node.kind), node.direction.major, 0, node.direction.a, node.direction.b,
                         node.offset, node.kind == TreeNode::Kind::leaf ? node.count : node.above});
    return saved;
}

/// Leaves list their triangles one after the other, so that where a leaf's begin need not be said.
std::vector<TreeNode> to_nodes(const std::vector<SavedNode> &saved) {
    std::vector<TreeNode> nodes(saved.size());
    std::uint32_t first = 0;
    for (std::size_t i = 0; i < saved.size(); ++i) {
        const SavedNode &from = saved[i];
        TreeNode &node = nodes[i];
        node.kind = TreeNode::Kind(from.kind);
        node.direction = {from.major, from.a, from.b};
        node.offset = from.offset;
        if (is_leaf(from)) {
            node.first = first;
            node.count = from.link;
            first += from.link;
        } else {
            node.above = from.link;
        }
    }
    return nodes;
}

std::uint64_t hash_of(Header header, const std::vector<SavedNode> &nodes,
                      const std::vector<std::uint32_t> &references) {
    header.hash = 0;
    Hash hash;
    hash.add(&header, sizeof header);
    hash.add(nodes.data(), nodes.size() * sizeof nodes[0]);
    hash.add(references.data(), references.size() * sizeof references[0]);
    return hash.value();
}

std::uint64_t key_of(const TriangleSet &set, const Settings &settings) {
    Settings shaping = settings;
    shaping.triangle_test = TriangleTest{}; // these decide nothing about the tree
    shaping.layout = LayoutKind{};
    shaping.simd = Simd{};
    shaping.precision = Precision{};
    shaping.early_exit = EarlyExit{};
    shaping.cached_dots = true;
    const std::string text = BSP_CORE_SOURCES + full_spec(shaping);
    Hash hash;
    hash.add(text.data(), text.size());
    for (const auto &[name, value] : list_settings(shaping))
        if (const double *number = std::get_if<double>(&value)) // the text has 12 of its digits
            hash.add(number, sizeof *number);
    hash.add(set.triangles.data(), set.triangles.size() * sizeof(Triangle));
    hash.add(set.valid.data(), set.valid.size() * sizeof set.valid[0]);
    hash.add(set.primitives.data(), set.primitives.size() * sizeof set.primitives[0]);
    return hash.value();
}

[[noreturn]] void refuse(const fs::path &path, const std::string &reason) {
    throw std::runtime_error("the saved tree " + path.string() + " " + reason);
}

/// The header of a file of `size` bytes, all its fields but the hash checked.
Header read_header(std::istream &in, const fs::path &path, std::uintmax_t size, std::uint64_t key) {
    Header header{};
    if (size < sizeof header || !in.read(reinterpret_cast<char *>(&header), sizeof header))
        refuse(path, "ends within its header");
    if (std::memcmp(header.magic, magic, sizeof magic) != 0)
        refuse(path, "is a file of another kind");
    if (header.byte_order != byte_order)
        refuse(path, "has the byte order of another machine");
    if (header.format_version != format_version)
        refuse(path, "has format version " + std::to_string(header.format_version) + ", but this library reads " +
                         std::to_string(format_version));
    if (header.key != key)
        refuse(path, "belongs to other triangles or settings");
    const std::uintmax_t payload = size - sizeof header;
    // Divided before multiplied: wild counts must not wrap around.
    if (header.node_count > payload / sizeof(SavedNode) || header.reference_count > payload / sizeof(std::uint32_t) ||
        header.node_count * sizeof(SavedNode) + header.reference_count * sizeof(std::uint32_t) != payload)
        refuse(path, "has " + std::to_string(size) + " bytes, which is not what its header says");
    return header;
}

template <typename T> void read_all(std::istream &in, const fs::path &path, std::vector<T> &values) {
    if (!in.read(reinterpret_cast<char *>(values.data()), std::streamsize(values.size() * sizeof(T))))
        refuse(path, "cannot be read to its end");
}

/// A file that is removed unless it was given its final name.
class TemporaryFile {
public:
    explicit TemporaryFile(const fs::path &final_path) : m_path(final_path) {
        std::random_device random;
        m_path += "." + std::to_string(random()) + std::to_string(random()) + ".part";
        m_file.reset(std::fopen(m_path.c_str(), "wbx")); // x: never a file that exists
        check(m_file != nullptr);
    }
    ~TemporaryFile() {
        std::error_code ignored;
        if (!m_path.empty())
            fs::remove(m_path, ignored);
    }
    TemporaryFile(const TemporaryFile &) = delete;
    TemporaryFile &operator=(const TemporaryFile &) = delete;

    void write(const void *data, std::size_t bytes) {
        check(bytes == 0 || std::fwrite(data, 1, bytes, m_file.get()) == bytes);
    }

    void rename(const fs::path &final_path) {
        check(std::fclose(m_file.release()) == 0);
        fs::rename(m_path, final_path);
        m_path.clear();
    }

private:
    static void check(bool succeeded) {
        if (!succeeded)
            throw std::system_error(errno, std::generic_category());
    }

    struct Close {
        void operator()(std::FILE *file) const { std::fclose(file); }
    };
    fs::path m_path;
    std::unique_ptr<std::FILE, Close> m_file;
};

} // namespace

TreeFile::TreeFile(const fs::path &folder, const TriangleSet &set, const Settings &settings)
    : m_key(key_of(set, settings)) {
    const std::string spec = full_spec(settings);
    char digits[17];
    std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(m_key));
    m_path = folder / (spec.substr(0, spec.find(':')) + "-" + digits + ".bsptree");
}

std::optional<Tree> TreeFile::load(const TriangleSet &set) const {
    std::error_code error;
    const fs::file_status status = fs::status(m_path, error);
    if (status.type() == fs::file_type::not_found)
        return {};
    std::ifstream in;
    if (fs::is_regular_file(status)) // opening a pipe would wait for a writer
        in.open(m_path, std::ios::binary | std::ios::ate);
    if (!in.is_open())
        refuse(m_path, "cannot be read");
    const auto size = std::uintmax_t(in.tellg());
    in.seekg(0);

    const Header header = read_header(in, m_path, size, m_key);
    std::vector<SavedNode> nodes(header.node_count);
    Tree tree;
    tree.references.resize(header.reference_count);
    read_all(in, m_path, nodes);
    read_all(in, m_path, tree.references);
    if (hash_of(header, nodes, tree.references) != header.hash)
        refuse(m_path, "is damaged: its hash is wrong");

    get_view(header, tree);
    tree.nodes = to_nodes(nodes);
    tree.sah_cost = header.sah_cost;
    tree.plane_tolerance = header.plane_tolerance;
    tree.capped_leaves = header.capped_leaves;
    tree.capped_references = header.capped_references;
    if (const std::string broken = validate(tree, set); !broken.empty())
        refuse(m_path, "is no valid tree: " + broken);
    describe_levels(tree);
    for (std::size_t depth = 0; depth <= depth_limit; ++depth)
        if (header.planes[depth] > 0) { // also where splits were undone: then there are no nodes
            tree.levels.resize(std::max(tree.levels.size(), depth + 1));
            tree.levels[depth].planes = header.planes[depth];
        }
    return tree;
}

void TreeFile::save(const Tree &tree) const {
    const std::vector<SavedNode> nodes = to_saved(tree.nodes);
    Header header{};
    std::memcpy(header.magic, magic, sizeof magic);
    header.byte_order = byte_order;
    header.format_version = format_version;
    header.key = m_key;
    header.node_count = nodes.size();
    header.reference_count = tree.references.size();
    set_view(tree, header);
    header.sah_cost = tree.sah_cost;
    header.plane_tolerance = tree.plane_tolerance;
    header.capped_leaves = tree.capped_leaves;
    header.capped_references = tree.capped_references;
    for (std::size_t depth = 0; depth < tree.levels.size(); ++depth)
        header.planes[depth] = tree.levels[depth].planes;
    header.hash = hash_of(header, nodes, tree.references);
    try {
        fs::create_directories(m_path.parent_path());
        TemporaryFile file(m_path);
        file.write(&header, sizeof header);
        file.write(nodes.data(), nodes.size() * sizeof nodes[0]);
        file.write(tree.references.data(), tree.references.size() * sizeof tree.references[0]);
        file.rename(m_path);
    } catch (const std::system_error &e) {
        throw std::runtime_error("the tree cannot be saved as " + m_path.string() + ": " + e.code().message());
    }
}

} // namespace bsp
