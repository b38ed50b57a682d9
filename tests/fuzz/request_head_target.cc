#include "server/http/request_head.h"

#include "tests/fuzz/fuzz.h"

void fuzz::run(std::span<const std::byte> bytes) {
  const auto head = server::http::parse_head(text_of(bytes));
  if (!head) return demand(head.error().status >= 400 && head.error().status < 600, "a refusal has a status");
  demand(!head->method.empty() && !head->path.empty(), "a request has a method and a path");
  demand(!(head->chunked && head->content_length), "a body has one length");
  (void)server::http::split_list(head->header("accept"));
}

std::vector<std::string> fuzz::seeds() {
  return {"GET /v1/scenes?x=1 HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: a, \"b,c\"\r\n\r\n",
          "POST http://a:1/x HTTP/1.1\r\nHost: b\r\nContent-Length: 10\r\nExpect: 100-continue\r\n\r\n",
          "PUT / HTTP/1.0\r\nTransfer-Encoding: chunked\r\nConnection: keep-alive\r\n\r\n"};
}
