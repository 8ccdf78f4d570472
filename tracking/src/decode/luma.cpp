#include "decode/luma.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "trochoid/data/error.hpp"

namespace trochoid::tracking {
namespace {

/// Formats whose first plane is nothing but luma.
bool has_luma_plane(const AVPixFmtDescriptor& format) {
  constexpr std::uint64_t kOther =
      AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_BITSTREAM |
      AV_PIX_FMT_FLAG_HWACCEL | AV_PIX_FMT_FLAG_FLOAT | AV_PIX_FMT_FLAG_BAYER | AV_PIX_FMT_FLAG_BE;
  const AVComponentDescriptor& y = format.comp[0];
  return (format.flags & kOther) == 0 && y.plane == 0 && y.offset == 0 &&
         y.step == (y.depth > 8 ? 2 : 1) && y.depth >= 8;
}

bool is_full_range(const AVFrame& picture, const AVPixFmtDescriptor& format) {
  if (picture.color_range == AVCOL_RANGE_JPEG) return true;
  if (picture.color_range == AVCOL_RANGE_MPEG) return false;
  const auto pixel_format = static_cast<AVPixelFormat>(picture.format);
  const bool jpeg = pixel_format == AV_PIX_FMT_YUVJ420P || pixel_format == AV_PIX_FMT_YUVJ422P ||
                    pixel_format == AV_PIX_FMT_YUVJ444P || pixel_format == AV_PIX_FMT_YUVJ440P;
  return jpeg || format.nb_components <= 2;  // gray, unless said otherwise
}

/// 16..235 -> 0..255. 149/128 stands for 255/219 (3e-4 off) so that the loop stays in 16 bits.
void stretch_row(const std::uint8_t* in, std::uint8_t* out, int width) {
  for (int x = 0; x < width; ++x) {
    const int above = std::max<int>(in[x], 16) - 16;
    const auto stretched =
        static_cast<std::uint16_t>(static_cast<std::uint16_t>(above * 149 + 64) >> 7);
    out[x] = static_cast<std::uint8_t>(std::min<std::uint16_t>(stretched, 255));
  }
}

/// Samples of so many bits, those below them included, to 8 bit, rounded, the range kept.
void narrow_row(const std::uint16_t* in, std::uint8_t* out, int width, int bits) {
  const int shift = bits - 8, half = 1 << (shift - 1);
  for (int x = 0; x < width; ++x)
    out[x] = static_cast<std::uint8_t>(std::min((in[x] + half) >> shift, 255));
}

/// One of the colour differences to 8 bit at half the size: the mean of all samples there.
void fill_chroma(const AVFrame& picture, const AVPixFmtDescriptor& format, int which,
                 cv::Mat& chroma) {
  const AVComponentDescriptor& c = format.comp[1 + which];
  const int across = 2 >> format.log2_chroma_w, down = 2 >> format.log2_chroma_h;
  const int width = AV_CEIL_RSHIFT(picture.width, format.log2_chroma_w);
  const int height = AV_CEIL_RSHIFT(picture.height, format.log2_chroma_h);
  const auto row = [&](int y) {
    return picture.data[c.plane] + c.offset +
           static_cast<std::ptrdiff_t>(std::min(y, height - 1)) * picture.linesize[c.plane];
  };
  const auto sample = [&](const std::uint8_t* in, int x) {
    const std::uint8_t* at = in + std::min(x, width - 1) * c.step;
    const int value = c.depth > 8 ? *reinterpret_cast<const std::uint16_t*>(at) : *at;
    return value >> c.shift;
  };
  const int unit = (across * down) << (c.depth - 8);
  for (int y = 0; y < chroma.rows; ++y) {
    const std::uint8_t *first = row(down * y), *last = row(down * y + down - 1);
    std::uint8_t* out = chroma.ptr(y) + which;
    for (int x = 0; x < chroma.cols; ++x, out += 2) {
      if (unit == 1) {  // most videos
        *out = first[x * c.step];
        continue;
      }
      int sum = unit / 2;
      for (int i = 0; i < across; ++i) {
        sum += sample(first, across * x + i);
        if (down > 1) sum += sample(last, across * x + i);
      }
      *out = static_cast<std::uint8_t>(std::min(sum / unit, 255));
    }
  }
}

std::string format_words(const AVFrame& picture) {
  const char* name = av_get_pix_fmt_name(static_cast<AVPixelFormat>(picture.format));
  return name != nullptr ? fmt::format("its pixel format {}", name)
                         : fmt::format("its pixel format, number {},", picture.format);
}

cv::Mat scaled_to(const AVFrame& picture, AVPixelFormat target, int type, Scaler& scaler) {
  scaler.reset(sws_getCachedContext(scaler.release(), picture.width, picture.height,
                                    static_cast<AVPixelFormat>(picture.format), picture.width,
                                    picture.height, target, SWS_BILINEAR | SWS_ACCURATE_RND,
                                    nullptr, nullptr, nullptr));
  if (!scaler) throw InputError(fmt::format("{} cannot be converted", format_words(picture)));
  const AVPixFmtDescriptor* format =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(picture.format));
  // What a picture says of its range is not in its format; levels of ours are full.
  constexpr int kNeutral = 1 << 16;
  const int* coefficients = sws_getCoefficients(picture.colorspace);
  if (format != nullptr && (format->flags & AV_PIX_FMT_FLAG_RGB) == 0)
    sws_setColorspaceDetails(scaler.get(), coefficients, is_full_range(picture, *format),
                             coefficients, 1, 0, kNeutral, kNeutral);
  cv::Mat image(picture.height, picture.width, type);
  std::uint8_t* planes[4] = {image.data, nullptr, nullptr, nullptr};
  const int strides[4] = {static_cast<int>(image.step), 0, 0, 0};
  sws_scale(scaler.get(), picture.data, picture.linesize, 0, picture.height, planes, strides);
  return image;
}

}  // namespace

cv::Mat luma_of(const AVFrame& picture, Scaler& scaler) {
  const AVPixFmtDescriptor* format =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(picture.format));
  if (format == nullptr) throw InputError(format_words(picture) + " is unknown");
  if (!has_luma_plane(*format)) return scaled_to(picture, AV_PIX_FMT_GRAY8, CV_8UC1, scaler);
  cv::Mat luma(picture.height, picture.width, CV_8UC1);
  const bool full = is_full_range(picture, *format);
  const int depth = format->comp[0].depth, bits = depth + format->comp[0].shift;
  for (int y = 0; y < picture.height; ++y) {
    const std::uint8_t* in = picture.data[0] + static_cast<std::ptrdiff_t>(y) * picture.linesize[0];
    std::uint8_t* out = luma.ptr(y);
    if (depth > 8) {
      narrow_row(reinterpret_cast<const std::uint16_t*>(in), out, picture.width, bits);
      in = out;
    }
    if (!full)
      stretch_row(in, out, picture.width);
    else if (in != out)
      std::copy(in, in + picture.width, out);
  }
  return luma;
}

cv::Mat chroma_of(const AVFrame& picture) {
  const AVPixFmtDescriptor* format =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(picture.format));
  constexpr int kComponents = 3;
  if (format == nullptr || !has_luma_plane(*format) || format->nb_components < kComponents ||
      format->log2_chroma_w > 1 || format->log2_chroma_h > 1)
    return {};
  cv::Mat chroma((picture.height + 1) / 2, (picture.width + 1) / 2, CV_8UC2);
  for (const int which : {0, 1}) fill_chroma(picture, *format, which, chroma);
  return chroma;
}

cv::Mat bgr_of(const AVFrame& picture, Scaler& scaler) {
  return scaled_to(picture, AV_PIX_FMT_BGR24, CV_8UC3, scaler);
}

}  // namespace trochoid::tracking
