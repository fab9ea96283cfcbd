// From the objects of a pickle to arrays by name.
#include <algorithm>
#include <cstring>
#include <optional>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/npy_internal.h"
#include "io/pickle.h"
#include "io/pickle_internal.h"
#include "io/shown_internal.h"
#include "io/zip_internal.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDepth = 16;
constexpr std::size_t kMaxVisits = 2'000'000;
constexpr std::size_t kMaxText = 4096;  ///< bytes of a text that is worth keeping

using MaybeArray = std::optional<NpyArray>;

/// Values in C order.
std::vector<double> ValuesOf(const NpyArray& array) {
  const Eigen::MatrixXd matrix = MatrixFrom({{"values", array}}, "values");
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(matrix.size()));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) values.push_back(matrix(i, j));
  }
  return values;
}

template <typename T>
NpyArray Scalar(const char* dtype, const T& value) {
  NpyArray array{dtype, {}, std::vector<std::uint8_t>(sizeof value)};
  std::memcpy(array.bytes.data(), &value, sizeof value);
  return array;
}

bool IsNumeric(const NpyArray& array) { return array.dtype[1] != 'U'; }

const PickleNode* Find(const PickleNode& dict, std::string_view key) {
  if (dict.kind != PickleKind::kDict) return nullptr;
  const PickleNode* found = nullptr;
  for (std::size_t i = 0; i + 1 < dict.items.size(); i += 2) {
    if (dict.items[i]->text == key) found = dict.items[i + 1];
  }
  return found;
}

class Flattener {
 public:
  Flattener(Npz& arrays, MemoryBudget& budget, const std::string& where)
      : arrays_(arrays), budget_(budget), where_(where) {}

  /// Puts an object under `name`, the contents of a dictionary under "name/key".
  void Put(const std::string& name, const PickleNode& node, int depth = 0) {
    Visit(depth);
    if (node.kind == PickleKind::kArray && !node.array && node.items.size() == 1) {
      Put(name, *node.items[0], depth + 1);
    } else if (node.kind == PickleKind::kDict) {
      for (std::size_t i = 0; i + 1 < node.items.size(); i += 2) {
        const std::string& key = node.items[i]->text;
        if (key.empty() || key.size() > 256) continue;
        Put(name.empty() ? key : name + "/" + key, *node.items[i + 1], depth + 1);
      }
    } else if (MaybeArray array = ArrayOf(node, depth); array && !name.empty()) {
      Charge(name.size());
      arrays_[name] = std::move(*array);
    }
  }

 private:
  void Visit(int depth) {
    Require(depth < kMaxDepth, where_ + ": the pickle is nested too deeply");
    Require(++visits_ < kMaxVisits, where_ + ": the pickle repeats its objects too often");
  }
  void Charge(std::size_t bytes) {
    Require(budget_.Take(bytes),
            where_ + ": the pickle's arrays are larger than the file can hold");
  }

  MaybeArray ArrayOf(const PickleNode& node, int depth) {
    Visit(depth);
    switch (node.kind) {
      case PickleKind::kBool:
        return Scalar("|b1", static_cast<std::uint8_t>(node.integer));
      case PickleKind::kInt:
        return Scalar("<i8", node.integer);
      case PickleKind::kReal:
        return Scalar("<f8", node.real);
      case PickleKind::kText:
      case PickleKind::kBytes:
        if (node.text.size() > kMaxText) return {};
        Charge(4 * node.text.size() + 4);
        return NpyFrom(node.text);
      case PickleKind::kList:
        return ListOf(node, depth);
      case PickleKind::kArray:
        if (!node.array) return ListOf(node, depth);
        Charge(node.array->bytes.size());
        return *node.array;
      case PickleKind::kObject:
        return ObjectOf(node, depth);
      default:
        return {};
    }
  }

  /// A list of numbers (1-d), of arrays of one length (2-d), or of numbers and arrays one after the
  /// other (1-d).
  MaybeArray ListOf(const PickleNode& node, int depth) {
    std::vector<double> values;
    std::size_t width = 0;
    bool scalars = true, even = true;
    for (const PickleNode* item : node.items) {
      const MaybeArray array = ArrayOf(*item, depth + 1);
      if (!array || !IsNumeric(*array)) return {};
      const std::vector<double> part = ValuesOf(*array);
      Charge(8 * part.size());
      scalars = scalars && array->shape.empty();
      even = even && (item == node.items[0] || part.size() == width);
      width = part.size();
      values.insert(values.end(), part.begin(), part.end());
    }
    NpyArray list = NpyFrom(values);
    if (!scalars && even) list.shape = {node.items.size(), width};
    return list;
  }

  MaybeArray ObjectOf(const PickleNode& node, int depth) {
    if (node.state == nullptr) return {};
    if (node.text.starts_with("scipy.")) return Dense(node, depth);
    if (const PickleNode* stored = Find(*node.state, "x")) return ArrayOf(*stored, depth + 1);
    return Selected(*node.state, depth);
  }

  /// chumpy's view of another array: a.ravel()[idxs].reshape(preferred_shape).
  MaybeArray Selected(const PickleNode& state, int depth) {
    const PickleNode *from = Find(state, "a"), *which = Find(state, "idxs");
    if (from == nullptr || which == nullptr) return {};
    const MaybeArray values = ArrayOf(*from, depth + 1), chosen = ArrayOf(*which, depth + 1);
    if (!values || !chosen || !IsNumeric(*values) || !IsNumeric(*chosen)) return {};
    const std::vector<double> all = ValuesOf(*values);
    const std::vector<int> at = IntsFrom({{"idxs", *chosen}}, "idxs");
    Charge(8 * (all.size() + at.size()));
    std::vector<double> selected;
    for (const int i : at) {
      Require(i >= 0 && static_cast<std::size_t>(i) < all.size(),
              where_ + ": a chumpy selection names an element that is not there");
      selected.push_back(all[static_cast<std::size_t>(i)]);
    }
    NpyArray array = NpyFrom(selected);
    if (const PickleNode* shape = Find(state, "preferred_shape")) {
      std::vector<std::size_t> sizes;
      for (const PickleNode* size : shape->items)
        sizes.push_back(static_cast<std::size_t>(std::max<std::int64_t>(0, size->integer)));
      if (!sizes.empty() && sizes.size() <= 8) array = Reshaped(std::move(array), sizes);
    }
    return array;
  }

  std::vector<double> Member(const PickleNode& state, std::string_view name, int depth) {
    const PickleNode* node = Find(state, name);
    const MaybeArray array = node == nullptr ? MaybeArray{} : ArrayOf(*node, depth + 1);
    Require(array && IsNumeric(*array),
            where_ + ": a sparse matrix has no '" + std::string(name) + "'");
    return ValuesOf(*array);
  }

  MaybeArray Dense(const PickleNode& node, int depth) {
    const auto wrong = [&](bool good) {
      Require(good, where_ + ": a sparse matrix is damaged: its indices do not fit its shape");
    };
    const bool by_column = node.text.find(".csc_") != std::string::npos;
    const std::vector<double> shape = Member(*node.state, "_shape", depth),
                              values = Member(*node.state, "data", depth),
                              indices = Member(*node.state, "indices", depth),
                              starts = Member(*node.state, "indptr", depth);
    wrong(shape.size() == 2 && shape[0] >= 0 && shape[1] >= 0 && shape[0] * shape[1] < 4e9 &&
          shape[0] < 4e9 && shape[1] < 4e9);
    const auto rows = static_cast<std::size_t>(shape[0]), cols = static_cast<std::size_t>(shape[1]);
    const std::size_t lines = by_column ? cols : rows, length = by_column ? rows : cols;
    wrong(starts.size() == lines + 1 && values.size() == indices.size());
    Charge(16 * rows * cols);
    std::vector<double> dense(rows * cols, 0);
    for (std::size_t line = 0; line < lines; ++line) {
      wrong(starts[line] >= 0 && starts[line] <= starts[line + 1] &&
            starts[line + 1] <= static_cast<double>(values.size()));
      for (auto e = static_cast<std::size_t>(starts[line]);
           e < static_cast<std::size_t>(starts[line + 1]); ++e) {
        wrong(indices[e] >= 0 && indices[e] < static_cast<double>(length));
        const auto at = static_cast<std::size_t>(indices[e]);
        dense[by_column ? at * cols + line : line * cols + at] += values[e];
      }
    }
    return Reshaped(NpyFrom(dense), {rows, cols});
  }

  Npz& arrays_;
  MemoryBudget& budget_;
  const std::string& where_;
  std::size_t visits_ = 0;
};

void PutPickle(Npz& arrays, const std::string& name, std::string_view bytes,
               const std::string& where, MemoryBudget& budget) {
  const Pickle pickle = ParsePickle(bytes, where, budget);
  Flattener(arrays, budget, where).Put(name, *pickle.root);
}

std::string_view TextOf(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// One .npy file; arrays of a dtype that is not read are left out.
void PutNpy(Npz& arrays, const std::string& name, std::span<const std::uint8_t> file,
            const std::string& where, MemoryBudget& budget) {
  NpyHeader header = ParseNpyHeader(file, where);
  const auto data = file.subspan(header.data_offset);
  if (header.HoldsObjects()) {
    PutPickle(arrays, name, TextOf(data), where, budget);
    return;
  }
  std::string plain = header.descr;
  if (plain[0] == '>' || plain[0] == '=') plain[0] = '<';
  if (!name.empty() && ItemSize(plain) > 0) arrays[name] = ArrayFrom(header, data, where);
}

Npz ReadArrays(const std::string& content, const std::string& where) {
  Npz arrays;
  MemoryBudget budget(content.size());
  const std::span<const std::uint8_t> bytes(reinterpret_cast<const std::uint8_t*>(content.data()),
                                            content.size());
  if (content.starts_with("PK\x03\x04")) {
    for (const auto& [name, entry] : ReadZip(content, where)) {
      if (!name.ends_with(".npy")) continue;
      const std::string key = name.substr(0, name.size() - 4);
      MemoryBudget entry_budget(entry.size());
      PutNpy(arrays, key, entry, where + ": array '" + Shown(key) + "'", entry_budget);
    }
  } else if (content.starts_with("\x93NUMPY")) {
    PutNpy(arrays, "", bytes, where, budget);
  } else {
    const bool pickle =
        !content.empty() && std::string_view("\x80(}]c").find(content[0]) != std::string_view::npos;
    Require(pickle, where + ": is neither npz nor npy nor a pickle");
    PutPickle(arrays, "", content, where, budget);
  }
  return arrays;
}

/// What `read` gives; every message starts with `where`.
template <typename Read>
Npz Located(const std::string& where, const Read& read) {
  try {
    Npz arrays = read();
    Require(!arrays.empty(), where + ": holds no dictionary of arrays");
    return arrays;
  } catch (const Error& error) {
    const std::string what = error.what();
    throw Error(what.starts_with(where) ? what : where + ": " + what);
  }
}

}  // namespace

Npz ParsePickledArrays(std::string_view pickle, const std::string& where) {
  return Located(where, [&] {
    Npz arrays;
    MemoryBudget budget(pickle.size());
    PutPickle(arrays, "", pickle, where, budget);
    return arrays;
  });
}

Npz ReadArrayDict(const fs::path& path) {
  return Located(path.string(), [&] { return ReadArrays(ReadFile(path), path.string()); });
}

}  // namespace sole::io
