#pragma once
extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/parseutils.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

#include <memory>
#include <string>

/// Owners of libav's C objects.
namespace trochoid::tracking {

struct LibavDeleter {
  void operator()(AVFormatContext* context) const { avformat_close_input(&context); }
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(SwsContext* context) const { sws_freeContext(context); }
};
using InputHandle = std::unique_ptr<AVFormatContext, LibavDeleter>;
using DecoderHandle = std::unique_ptr<AVCodecContext, LibavDeleter>;
using PacketHandle = std::unique_ptr<AVPacket, LibavDeleter>;
using PictureHandle = std::unique_ptr<AVFrame, LibavDeleter>;
using Scaler = std::unique_ptr<SwsContext, LibavDeleter>;

/// What a libav status means, in libav's words.
[[nodiscard]] inline std::string libav_words(int status) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(status, text, sizeof text);
  return text;
}

}  // namespace trochoid::tracking
