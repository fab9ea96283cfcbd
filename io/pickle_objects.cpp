// The classes and functions that a pickle of arrays names, as plain data.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/error.h"
#include "io/npy_internal.h"
#include "io/pickle_internal.h"
#include "io/shown_internal.h"

namespace sole::io {
namespace {

constexpr std::size_t kMaxNodes = 1'000'000;

bool IsOneOf(std::string_view name, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool IsSparse(std::string_view name) {
  return name.starts_with("scipy.sparse.") &&
         (name.ends_with(".csc_matrix") || name.ends_with(".csr_matrix") ||
          name.ends_with(".csc_array") || name.ends_with(".csr_array"));
}

bool IsInert(std::string_view name) { return name.starts_with("chumpy.") || IsSparse(name); }

bool IsCollection(std::string_view name) {
  return IsOneOf(name, {"collections.OrderedDict", "builtins.dict", "builtins.set",
                        "builtins.frozenset", "builtins.list", "builtins.tuple"});
}

bool IsNumpy(std::string_view name) {
  return IsOneOf(name, {"numpy.ndarray", "numpy.dtype", "numpy.core.multiarray._reconstruct",
                        "numpy.core.multiarray.scalar", "numpy.core.numeric._frombuffer"});
}

bool IsOther(std::string_view name) {
  return IsOneOf(name, {"copyreg._reconstructor", "builtins.object", "builtins.bytes",
                        "builtins.bytearray", "_codecs.encode"});
}

/// One name for what several versions of Python and numpy call differently.
std::string Canonical(std::string name) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 3> kOther = {
      {{"__builtin__.", "builtins."}, {"copy_reg.", "copyreg."}, {"numpy._core.", "numpy.core."}}};
  for (const auto& [from, to] : kOther) {
    if (name.starts_with(from)) return std::string(to) + name.substr(from.size());
  }
  return name;
}

std::size_t Length(const PickleNode& tuple) {
  return tuple.kind == PickleKind::kList ? tuple.items.size() : 0;
}

bool IsText(const PickleNode& node) {
  return node.kind == PickleKind::kText || node.kind == PickleKind::kBytes;
}

}  // namespace

PickleNode* Pickle::Add(PickleKind kind, const std::string& where) {
  Require(nodes.size() < kMaxNodes, where + ": the pickle holds more than a million objects");
  nodes.emplace_back();
  nodes.back().kind = kind;
  return &nodes.back();
}

void PickleObjects::Refuse(const std::string& what) const {
  throw Error(where_ + ": the pickle " + what +
              "; pickles are programs, so only arrays, numbers and text are read");
}

PickleNode* PickleObjects::Class(const std::string& name) {
  const std::string known = Canonical(name);
  if (!IsNumpy(known) && !IsCollection(known) && !IsOther(known) && !IsInert(known))
    Refuse("names '" + Shown(name) + "'");
  PickleNode* node = pickle_.Add(PickleKind::kClass, where_);
  node->text = known;
  return node;
}

PickleNode* PickleObjects::New(const PickleNode& type) {
  if (type.kind != PickleKind::kClass) Refuse("makes an object of something that is no class");
  if (type.text == "collections.OrderedDict" || type.text == "builtins.dict")
    return pickle_.Add(PickleKind::kDict, where_);
  if (!IsInert(type.text)) Refuse("makes an object of '" + Shown(type.text) + "'");
  PickleNode* object = pickle_.Add(PickleKind::kObject, where_);
  object->text = type.text;
  return object;
}

PickleNode* PickleObjects::Call(const PickleNode& callable, const PickleNode& arguments) {
  if (callable.kind != PickleKind::kClass || arguments.kind != PickleKind::kList)
    Refuse("calls something that is no function");
  const std::string& name = callable.text;
  if (IsNumpy(name)) return CallNumpy(name, arguments);
  if (name == "copyreg._reconstructor" && Length(arguments) == 3) return New(*arguments.items[0]);
  if (name == "_codecs.encode" && Length(arguments) == 2) return Encoded(arguments);
  if (IsInert(name)) return New(callable);
  const bool bytes = name == "builtins.bytes" || name == "builtins.bytearray";
  if (bytes && Length(arguments) == 0) return pickle_.Add(PickleKind::kBytes, where_);
  if (bytes && Length(arguments) == 1 && arguments.items[0]->kind == PickleKind::kBytes)
    return arguments.items[0];
  if (bytes && Length(arguments) == 2) return Encoded(arguments);
  if (!IsCollection(name) || Length(arguments) > 1)
    Refuse("calls '" + Shown(name) + "' in an unknown way");
  const bool dict = name.ends_with("ict");
  PickleNode* made = pickle_.Add(dict ? PickleKind::kDict : PickleKind::kList, where_);
  if (Length(arguments) == 0) return made;
  for (PickleNode* item : arguments.items[0]->items) {
    if (!dict) made->items.push_back(item);
    if (!dict) continue;
    if (Length(*item) != 2) Refuse("makes a dictionary of something else than pairs");
    made->items.insert(made->items.end(), item->items.begin(), item->items.end());
  }
  if (!budget_.Take(made->items.size() * sizeof(PickleNode*)))
    Refuse("repeats its lists too often");
  return made;
}

/// encode(text, "latin1"): how Python 3 writes bytes into old protocols.
PickleNode* PickleObjects::Encoded(const PickleNode& arguments) {
  const PickleNode &text = *arguments.items[0], &codec = *arguments.items[1];
  if (text.kind != PickleKind::kText || !IsText(codec) ||
      !IsOneOf(codec.text, {"latin1", "latin-1", "iso-8859-1"}))
    Refuse("encodes text in an unknown way");
  if (!budget_.Take(text.text.size())) Refuse("repeats its text too often");
  PickleNode* bytes = pickle_.Add(PickleKind::kBytes, where_);
  bytes->text.reserve(text.text.size());
  for (std::size_t i = 0; i < text.text.size(); ++i) {
    const auto lead = static_cast<unsigned char>(text.text[i]);
    if (lead < 0x80) {
      bytes->text += static_cast<char>(lead);
      continue;
    }
    if ((lead != 0xc2 && lead != 0xc3) || i + 1 == text.text.size())
      Refuse("holds text that is not latin1 where bytes should stand");
    const auto next = static_cast<unsigned char>(text.text[++i]);
    bytes->text += static_cast<char>((lead & 3) << 6 | (next & 0x3f));
  }
  return bytes;
}

PickleNode* PickleObjects::CallNumpy(const std::string& name, const PickleNode& arguments) {
  const std::vector<PickleNode*>& given = arguments.items;
  if (name == "numpy.core.multiarray._reconstruct") return pickle_.Add(PickleKind::kArray, where_);
  if (name == "numpy.dtype" && !given.empty() && IsText(*given[0])) {
    PickleNode* dtype = pickle_.Add(PickleKind::kDtype, where_);
    dtype->text = "|" + given[0]->text.substr(0, 32);
    return dtype;
  }
  PickleNode* array = pickle_.Add(PickleKind::kArray, where_);
  if (name == "numpy.core.multiarray.scalar" && given.size() == 2) {
    FillArray(*array, *pickle_.Add(PickleKind::kList, where_), *given[0], false, *given[1]);
    return array;
  }
  if (name == "numpy.core.numeric._frombuffer" && given.size() == 4 && IsText(*given[3])) {
    FillArray(*array, *given[2], *given[1], given[3]->text == "F", *given[0]);
    return array;
  }
  Refuse("calls '" + Shown(name) + "' in an unknown way");
}

void PickleObjects::SetState(PickleNode& object, PickleNode& state) {
  if (object.kind == PickleKind::kObject || object.kind == PickleKind::kDict) {
    object.state = &state;
    return;
  }
  if (object.kind == PickleKind::kDtype && Length(state) >= 2 && IsText(*state.items[1])) {
    const std::string& order = state.items[1]->text;
    if (!IsOneOf(order, {"<", ">", "|", "="})) Refuse("holds an unknown dtype");
    object.text[0] = order[0];
    return;
  }
  if (object.kind == PickleKind::kArray && Length(state) >= 4) {
    const std::size_t first = Length(state) - 4;  // an optional version stands before
    const PickleNode& fortran = *state.items[first + 2];
    FillArray(object, *state.items[first], *state.items[first + 1], fortran.integer != 0,
              *state.items[first + 3]);
    return;
  }
  Refuse("gives an object a state in an unknown way");
}

void PickleObjects::FillArray(PickleNode& array, const PickleNode& shape, const PickleNode& dtype,
                              bool fortran, const PickleNode& data) {
  if (dtype.kind != PickleKind::kDtype || shape.kind != PickleKind::kList)
    Refuse("holds an array without dtype or shape");
  NpyHeader header{dtype.text, fortran, {}, 0};
  for (const PickleNode* size : shape.items) {
    if (size->kind != PickleKind::kInt || size->integer < 0 || header.shape.size() == 32)
      Refuse("holds an array of an impossible shape");
    header.shape.push_back(static_cast<std::size_t>(size->integer));
  }
  array.items.clear();
  array.array.reset();
  if (header.HoldsObjects() || header.descr == "|O8" || header.descr == "|O4") {
    if (data.kind == PickleKind::kList) array.items = data.items;
    if (!budget_.Take(array.items.size() * sizeof(PickleNode*)))
      Refuse("repeats its arrays too often");
    return;
  }
  std::string plain = header.descr;
  if (plain[0] == '>' || plain[0] == '=') plain[0] = '<';
  if (ItemSize(plain) == 0) return;
  if (data.kind != PickleKind::kBytes) Refuse("holds an array without data");
  if (!budget_.Take(2 * data.text.size())) Refuse("repeats its arrays too often");
  array.array = std::make_unique<NpyArray>(ArrayFrom(
      std::move(header),
      {reinterpret_cast<const std::uint8_t*>(data.text.data()), data.text.size()}, where_));
}

}  // namespace sole::io
