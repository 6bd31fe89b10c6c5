// What `alignerf.kernels.build` compiles, and JAX calls by these names.
#include "adam.h"
#include "histograms.h"
#include "lookup.h"

namespace ffi = xla::ffi;
using Array = ffi::Buffer<ffi::F32>;
using Counts = ffi::Span<const int32_t>;

// All take three arrays at least, and make one.
inline auto arrays() {
  return ffi::Ffi::Bind().Arg<Array>().Arg<Array>().Arg<Array>();
}

XLA_FFI_DEFINE_HANDLER_SYMBOL(
    alignerf_lookup, lookup::Forward,
    arrays().Ret<Array>().Attr<Counts>("resolutions").Attr<Counts>("entries"));
XLA_FFI_DEFINE_HANDLER_SYMBOL(alignerf_lookup_gradient, lookup::Backward,
                              arrays()
                                  .Arg<Array>()
                                  .Ret<Array>()
                                  .Ret<Array>()
                                  .Ret<Array>()
                                  .Attr<Counts>("resolutions")
                                  .Attr<Counts>("entries"));
XLA_FFI_DEFINE_HANDLER_SYMBOL(
    alignerf_resample, histograms::Resample,
    arrays().Arg<Array>().Ret<Array>().Attr<float>("dilation").Attr<bool>("jittered"));
XLA_FFI_DEFINE_HANDLER_SYMBOL(alignerf_interlevel, histograms::Interlevel,
                              arrays().Arg<Array>().Ret<Array>().Ret<Array>());
XLA_FFI_DEFINE_HANDLER_SYMBOL(alignerf_adam, adam::Update,
                              arrays()
                                  .Arg<Array>()
                                  .Ret<Array>()
                                  .Ret<Array>()
                                  .Ret<Array>()
                                  .Attr<float>("beta_1")
                                  .Attr<float>("beta_2")
                                  .Attr<float>("rest_1")
                                  .Attr<float>("rest_2")
                                  .Attr<float>("eps"));
