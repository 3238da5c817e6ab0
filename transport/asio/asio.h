// Boost.Asio, as this folder uses it. Compiled once, in asio_impl.cpp (BOOST_ASIO_SEPARATE_COMPILATION).
#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>

namespace tessera::transport {

namespace asio = boost::asio;
using SystemError = boost::system::error_code;

}  // namespace tessera::transport
