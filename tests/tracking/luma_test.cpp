#include "decode/luma.hpp"

#include <gtest/gtest.h>

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <cstdint>
#include <memory>

namespace trochoid::tracking {
namespace {

constexpr int kOddWidth = 7, kOddHeight = 5;  // odd: planes of half the size are rounded up

// What is coded for a pixel of the half-size planes, 0..255.
std::uint8_t cb_at(int x, int y) {
  return static_cast<std::uint8_t>(40 + 20 * x + 7 * y);
}
std::uint8_t cr_at(int x, int y) {
  return static_cast<std::uint8_t>(200 - 11 * x - 9 * y);
}

// A picture that says this in some format, sample by sample.
PictureHandle coded_as(AVPixelFormat pixel_format) {
  PictureHandle frame(av_frame_alloc());
  frame->format = pixel_format, frame->width = kOddWidth, frame->height = kOddHeight;
  EXPECT_EQ(av_frame_get_buffer(frame.get(), 0), 0);
  const AVPixFmtDescriptor& format = *av_pix_fmt_desc_get(pixel_format);
  for (const int which : {1, 2}) {
    const AVComponentDescriptor& c = format.comp[which];
    for (int y = 0; y < AV_CEIL_RSHIFT(kOddHeight, format.log2_chroma_h); ++y)
      for (int x = 0; x < AV_CEIL_RSHIFT(kOddWidth, format.log2_chroma_w); ++x) {
        const int hx = x >> (1 - format.log2_chroma_w), hy = y >> (1 - format.log2_chroma_h);
        const int value = (which == 1 ? cb_at(hx, hy) : cr_at(hx, hy)) << (c.depth - 8) << c.shift;
        std::uint8_t* at =
            frame->data[c.plane] + y * frame->linesize[c.plane] + x * c.step + c.offset;
        if (c.depth > 8)
          *reinterpret_cast<std::uint16_t*>(at) = static_cast<std::uint16_t>(value);
        else
          *at = static_cast<std::uint8_t>(value);
      }
  }
  return frame;
}

// Telephones film in ten bits, editing programs and some cameras at full width or side by side.
TEST(Chroma, IsTheSameHoweverItIsCoded) {
  for (const AVPixelFormat pixel_format :
       {AV_PIX_FMT_YUV420P, AV_PIX_FMT_YUVJ420P, AV_PIX_FMT_YUV420P10LE, AV_PIX_FMT_P010LE,
        AV_PIX_FMT_NV12, AV_PIX_FMT_NV21, AV_PIX_FMT_YUV422P, AV_PIX_FMT_YUV422P10LE,
        AV_PIX_FMT_YUV444P, AV_PIX_FMT_YUV444P12LE}) {
    const cv::Mat chroma = chroma_of(*coded_as(pixel_format));
    ASSERT_EQ(chroma.size(), cv::Size(4, 3)) << av_get_pix_fmt_name(pixel_format);
    for (int y = 0; y < chroma.rows; ++y)
      for (int x = 0; x < chroma.cols; ++x)
        EXPECT_EQ(chroma.at<cv::Vec2b>(y, x), cv::Vec2b(cb_at(x, y), cr_at(x, y)))
            << av_get_pix_fmt_name(pixel_format) << " " << x << ", " << y;
  }
}

// Ten bits in the upper part of sixteen.
TEST(Luma, IsReadWhereverItsBitsLie) {
  constexpr int kLevel = 100, kLimited = 16 + kLevel * 219 / 255;
  for (const AVPixelFormat pixel_format :
       {AV_PIX_FMT_GRAY8, AV_PIX_FMT_YUV420P, AV_PIX_FMT_YUV420P10LE, AV_PIX_FMT_P010LE}) {
    PictureHandle frame(av_frame_alloc());
    frame->format = pixel_format, frame->width = kOddWidth, frame->height = kOddHeight;
    ASSERT_EQ(av_frame_get_buffer(frame.get(), 0), 0);
    const AVComponentDescriptor& c = av_pix_fmt_desc_get(pixel_format)->comp[0];
    const int level = pixel_format == AV_PIX_FMT_GRAY8 ? kLevel : kLimited;
    for (int y = 0; y < kOddHeight; ++y)
      for (int x = 0; x < kOddWidth; ++x) {
        std::uint8_t* at = frame->data[0] + y * frame->linesize[0] + x * c.step;
        if (c.depth > 8)
          *reinterpret_cast<std::uint16_t*>(at) =
              static_cast<std::uint16_t>(level << (c.depth - 8) << c.shift);
        else
          *at = static_cast<std::uint8_t>(level);
      }
    Scaler scaler;
    const cv::Mat luma = luma_of(*frame, scaler);
    for (int y = 0; y < kOddHeight; ++y)
      for (int x = 0; x < kOddWidth; ++x)
        EXPECT_NEAR(luma.at<std::uint8_t>(y, x), kLevel, 1) << av_get_pix_fmt_name(pixel_format);
  }
}

TEST(Chroma, IsEmptyWhereThereIsNoneOfItsOwn) {
  for (const AVPixelFormat pixel_format :
       {AV_PIX_FMT_GRAY8, AV_PIX_FMT_GRAY10LE, AV_PIX_FMT_BGR24}) {
    PictureHandle frame(av_frame_alloc());
    frame->format = pixel_format, frame->width = kOddWidth, frame->height = kOddHeight;
    ASSERT_EQ(av_frame_get_buffer(frame.get(), 0), 0);
    EXPECT_TRUE(chroma_of(*frame).empty()) << av_get_pix_fmt_name(pixel_format);
  }
}

}  // namespace
}  // namespace trochoid::tracking
