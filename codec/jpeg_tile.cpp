#include "codec/jpeg_tile.h"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <string>

extern "C" {
#include <jpeglib.h>
// Behind it: it has no includes of its own.
#include <jerror.h>
}

namespace tessera::codec {
namespace {

constexpr int kMcuRows = 16;  // lines of luma that libjpeg takes at a time

// Annex K's chroma steps grow from 17 to 99, for eyes that see fine colours badly. At half of luma's
// resolution one for all is nearer to the truth at equal bits, in luma and in RGB (docs/layouts.md).
constexpr uint16_t kChromaQuantiser = 64;

// libjpeg reports errors by a callback that must not return. This one jumps back to where `jump` was set; no
// object with a destructor may be made in between.
struct Errors {
  jpeg_error_mgr manager{};  // first: libjpeg hands back its address
  std::jmp_buf jump{};
  std::array<char, JMSG_LENGTH_MAX> text{};

  Errors() {
    jpeg_std_error(&manager);
    manager.error_exit = [](j_common_ptr codec) {
      auto& self = *reinterpret_cast<Errors*>(codec->err);
      codec->err->format_message(codec, self.text.data());
      std::longjmp(self.jump, 1);
    };
    // A warning is what the decoder could make up for: the message of the first is kept.
    manager.output_message = [](j_common_ptr codec) {
      codec->err->format_message(codec, reinterpret_cast<Errors*>(codec->err)->text.data());
    };
  }
  std::string message() const { return text.data(); }
};

// Pointers to the lines of one row of MCUs, as libjpeg wants them.
struct McuRow {
  std::array<JSAMPROW, kMcuRows> y{};
  std::array<JSAMPROW, kMcuRows / 2> u{}, v{};
  std::array<JSAMPARRAY, 3> planes{};

  void point_at(JSAMPLE* luma, JSAMPLE* blue, JSAMPLE* red, uint32_t width, uint32_t line) {
    for (uint32_t i = 0; i < y.size(); ++i) y[i] = luma + size_t{line + i} * width;
    for (uint32_t i = 0; i < u.size(); ++i) {
      const size_t at = size_t{line / 2 + i} * (width / 2);
      u[i] = blue + at;
      v[i] = red + at;
    }
    planes = {y.data(), u.data(), v.data()};
  }
};

// Room for the worst case: codes made for another picture may take 16 bits for the symbol of a coefficient,
// then up to 11 of its own, each bit of which may be in a byte 0xff that is stuffed. 4:2:0 has 1.5
// coefficients a texel.
constexpr size_t max_compressed_bytes(size_t luma_samples) {
  constexpr size_t kBitsATexel = 2 * 27 * 3 / 2;
  return kBitsATexel * luma_samples / 8 + 2048;
}

}  // namespace

struct JpegCompressor::Impl {
  jpeg_compress_struct codec{};
  Errors errors;
  jpeg_destination_mgr destination{};
  std::vector<uint8_t> buffer;
  std::array<std::array<uint16_t, DCTSIZE2>, 2> quantisers{};  // of luma and chroma, at a scale of 1
  bool ready = false;

  Impl() { ready = set_up(); }
  ~Impl() { jpeg_destroy_compress(&codec); }

  bool set_up();
  void set_scale(double scale);
  void set_codes(const JpegCodes& codes);
  JpegCodes codes() const;
  void begin_output(size_t luma_samples);
  bool write_tables(double scale, const JpegCodes& codes);
  // Without `codes` it makes its own.
  bool write_picture(const YuvImage& picture, double scale, const JpegCodes* codes);
  void write_lines(const YuvImage& picture);
  StatusOr<std::vector<uint8_t>> result(bool good);
};

bool JpegCompressor::Impl::set_up() {
  codec.err = &errors.manager;
  if (setjmp(errors.jump)) return false;
  jpeg_create_compress(&codec);
  codec.dest = &destination;
  destination.init_destination = [](j_compress_ptr) {};
  destination.empty_output_buffer = [](j_compress_ptr c) -> boolean {
    ERREXIT(c, JERR_BUFFER_SIZE);
    return FALSE;
  };
  destination.term_destination = [](j_compress_ptr) {};
  codec.input_components = 3;
  codec.in_color_space = JCS_YCbCr;
  jpeg_set_defaults(&codec);
  jpeg_set_linear_quality(&codec, 100, TRUE);
  std::copy_n(codec.quant_tbl_ptrs[0]->quantval, DCTSIZE2, quantisers[0].begin());
  quantisers[1].fill(kChromaQuantiser);
  // JFIF promises BT.601 colours of full range; these are not (base/yuv.h).
  codec.write_JFIF_header = FALSE;
  codec.raw_data_in = TRUE;
  return true;
}

void JpegCompressor::Impl::set_scale(double scale) {
  for (int table = 0; table < 2; ++table) {
    unsigned int scaled[DCTSIZE2];
    for (int i = 0; i < DCTSIZE2; ++i)
      scaled[i] = static_cast<unsigned int>(std::clamp(scale * quantisers[table][i] + 0.5, 1.0, 255.0));
    jpeg_add_quant_table(&codec, table, scaled, 100, TRUE);
  }
}

void JpegCompressor::Impl::set_codes(const JpegCodes& codes) {
  const auto set = [](JHUFF_TBL* table, const JpegCode& code) {
    std::ranges::copy(code.counts, table->bits);
    std::ranges::copy(code.symbols, table->huffval);
  };
  for (size_t table = 0; table < 2; ++table) {
    set(codec.dc_huff_tbl_ptrs[table], codes.dc[table]);
    set(codec.ac_huff_tbl_ptrs[table], codes.ac[table]);
  }
}

JpegCodes JpegCompressor::Impl::codes() const {
  const auto get = [](const JHUFF_TBL* table, JpegCodeKind kind) {
    JpegCode code;
    std::ranges::copy(table->bits, code.counts.begin());
    std::ranges::copy(table->huffval, code.symbols.begin());
    return completed(code, kind);
  };
  JpegCodes codes;
  for (size_t table = 0; table < 2; ++table) {
    codes.dc[table] = get(codec.dc_huff_tbl_ptrs[table], JpegCodeKind::dc);
    codes.ac[table] = get(codec.ac_huff_tbl_ptrs[table], JpegCodeKind::ac);
  }
  return codes;
}

void JpegCompressor::Impl::begin_output(size_t luma_samples) {
  buffer.resize(std::max(buffer.size(), max_compressed_bytes(luma_samples)));
  destination.next_output_byte = buffer.data();
  destination.free_in_buffer = buffer.size();
}

bool JpegCompressor::Impl::write_tables(double scale, const JpegCodes& codes) {
  if (setjmp(errors.jump)) return false;
  set_scale(scale);
  set_codes(codes);
  jpeg_suppress_tables(&codec, FALSE);
  jpeg_write_tables(&codec);
  return true;
}

bool JpegCompressor::Impl::write_picture(const YuvImage& picture, double scale, const JpegCodes* codes) {
  if (setjmp(errors.jump)) return false;
  codec.image_width = picture.width;
  codec.image_height = picture.height;
  codec.optimize_coding = codes ? FALSE : TRUE;
  set_scale(scale);
  if (codes) set_codes(*codes);
  jpeg_suppress_tables(&codec, TRUE);
  jpeg_start_compress(&codec, FALSE);
  write_lines(picture);
  jpeg_finish_compress(&codec);
  return true;
}

void JpegCompressor::Impl::write_lines(const YuvImage& picture) {
  McuRow row;
  for (uint32_t line = 0; line < picture.height; line += kMcuRows) {
    // libjpeg's interface knows no const; it only reads.
    row.point_at(const_cast<JSAMPLE*>(picture.y.data()), const_cast<JSAMPLE*>(picture.u.data()),
                 const_cast<JSAMPLE*>(picture.v.data()), picture.width, line);
    jpeg_write_raw_data(&codec, row.planes.data(), kMcuRows);
  }
}

StatusOr<std::vector<uint8_t>> JpegCompressor::Impl::result(bool good) {
  if (!good) {
    jpeg_abort_compress(&codec);
    return absl::InternalError(absl::StrCat("libjpeg: ", errors.message()));
  }
  return std::vector<uint8_t>(buffer.data(), buffer.data() + buffer.size() - destination.free_in_buffer);
}

JpegCompressor::JpegCompressor() : impl_(std::make_unique<Impl>()) {}
JpegCompressor::~JpegCompressor() = default;
JpegCompressor::JpegCompressor(JpegCompressor&&) noexcept = default;

StatusOr<JpegCompressor::Fitted> JpegCompressor::codes_for(const YuvImage& picture, double scale) {
  Impl& c = *impl_;
  c.begin_output(picture.y.size());
  TESSERA_ASSIGN_OR_RETURN(const auto bytes, c.result(c.ready && c.write_picture(picture, scale, nullptr)));
  return Fitted{c.codes(), bytes.size()};
}

StatusOr<std::vector<uint8_t>> JpegCompressor::tables(double scale, const JpegCodes& codes) {
  Impl& c = *impl_;
  c.begin_output(0);
  return c.result(c.ready && c.write_tables(scale, codes));
}

StatusOr<std::vector<uint8_t>> JpegCompressor::compress(const YuvImage& picture, double scale,
                                                        const JpegCodes& codes) {
  Impl& c = *impl_;
  c.begin_output(picture.y.size());
  return c.result(c.ready && c.write_picture(picture, scale, &codes));
}

struct JpegDecompressor::Impl {
  jpeg_decompress_struct codec{};
  Errors errors;
  bool ready = false;

  Impl() { ready = set_up(); }
  ~Impl() { jpeg_destroy_decompress(&codec); }

  bool set_up();
  void forget_tables();
  const char* check_tables() const;
  const char* check(const YuvImage& expected) const;
  const char* read(std::span<const uint8_t> tables, std::span<const uint8_t> tile, YuvImage& picture);
  const char* read_picture(YuvImage& picture);
};

bool JpegDecompressor::Impl::set_up() {
  codec.err = &errors.manager;
  if (setjmp(errors.jump)) return false;
  jpeg_create_decompress(&codec);
  return true;
}

// libjpeg keeps them from picture to picture.
void JpegDecompressor::Impl::forget_tables() {
  for (JQUANT_TBL* table : codec.quant_tbl_ptrs)
    if (table) std::ranges::fill(table->quantval, UINT16{0});
  for (int i = 0; i < NUM_HUFF_TBLS; ++i)
    for (JHUFF_TBL* table : {codec.dc_huff_tbl_ptrs[i], codec.ac_huff_tbl_ptrs[i]})
      if (table) std::ranges::fill(table->bits, UINT8{0});
}

const char* JpegDecompressor::Impl::check_tables() const {
  const auto has_codes = [](const JHUFF_TBL* table) {
    return table && std::ranges::any_of(table->bits, [](UINT8 count) { return count > 0; });
  };
  for (int i = 0; i < 2; ++i) {
    const JQUANT_TBL* quantisers = codec.quant_tbl_ptrs[i];
    if (!quantisers || std::ranges::count(quantisers->quantval, 0) > 0 ||
        !has_codes(codec.dc_huff_tbl_ptrs[i]) || !has_codes(codec.ac_huff_tbl_ptrs[i]))
      return "a table is missing";
  }
  return nullptr;
}

// Whether the header says what our tiles are; everything else libjpeg would have to convert or to collect.
const char* JpegDecompressor::Impl::check(const YuvImage& expected) const {
  if (codec.image_width != expected.width || codec.image_height != expected.height)
    return "the tile's size is not that of its squares";
  if (codec.progressive_mode || codec.arith_code || codec.num_components != 3 || codec.comps_in_scan != 3)
    return "a tile must be baseline JPEG of three components in one scan";
  const jpeg_component_info* c = codec.comp_info;
  if (c[0].h_samp_factor != 2 || c[0].v_samp_factor != 2 || c[1].h_samp_factor != 1 ||
      c[1].v_samp_factor != 1 || c[2].h_samp_factor != 1 || c[2].v_samp_factor != 1)
    return "a tile must be 4:2:0";
  return nullptr;
}

// An explanation of what is wrong, or null. Nothing here may have a destructor (Errors).
const char* JpegDecompressor::Impl::read(std::span<const uint8_t> tables, std::span<const uint8_t> tile,
                                         YuvImage& picture) {
  if (setjmp(errors.jump)) return errors.text.data();
  codec.err->num_warnings = 0;
  forget_tables();
  jpeg_mem_src(&codec, tables.data(), tables.size());
  if (jpeg_read_header(&codec, FALSE) != JPEG_HEADER_TABLES_ONLY)
    return "the tables' part holds a picture as well";
  if (const char* wrong = check_tables()) return wrong;
  jpeg_mem_src(&codec, tile.data(), tile.size());
  jpeg_read_header(&codec, TRUE);
  if (const char* wrong = check(picture)) return wrong;
  return read_picture(picture);
}

const char* JpegDecompressor::Impl::read_picture(YuvImage& picture) {
  codec.raw_data_out = TRUE;
  codec.do_fancy_upsampling = FALSE;
  jpeg_start_decompress(&codec);
  McuRow row;
  for (uint32_t line = 0; line < picture.height; line += kMcuRows) {
    row.point_at(picture.y.data(), picture.u.data(), picture.v.data(), picture.width, line);
    jpeg_read_raw_data(&codec, row.planes.data(), kMcuRows);
    if (codec.err->num_warnings > 0) return errors.text.data();
  }
  jpeg_finish_decompress(&codec);
  if (codec.err->num_warnings > 0) return errors.text.data();
  return codec.src->bytes_in_buffer > 0 ? "bytes behind the tile's end" : nullptr;
}

JpegDecompressor::JpegDecompressor() : impl_(std::make_unique<Impl>()) {}
JpegDecompressor::~JpegDecompressor() = default;
JpegDecompressor::JpegDecompressor(JpegDecompressor&&) noexcept = default;

Status JpegDecompressor::decompress(std::span<const uint8_t> tables, std::span<const uint8_t> tile,
                                    YuvImage& picture) {
  Impl& d = *impl_;
  if (!d.ready) return absl::InternalError(absl::StrCat("libjpeg: ", d.errors.message()));
  // libjpeg takes these for a programming error.
  if (tables.empty() || tile.empty()) return absl::InvalidArgumentError("JPEG: an empty part");
  const char* wrong = d.read(tables, tile, picture);
  if (!wrong) return absl::OkStatus();
  const Status status = absl::InvalidArgumentError(absl::StrCat("JPEG: ", wrong));
  jpeg_abort_decompress(&d.codec);
  return status;
}

}  // namespace tessera::codec
